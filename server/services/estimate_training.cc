#include "server/services/estimate_training.h"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <optional>
#include <vector>

#include "absl/strings/str_cat.h"
#include "core/base/status_macros.h"
#include "core/features/estimate_features.h"
#include "core/priors/sam/sam_needs.h"
#include "core/reconstruct/estimate.h"
#include "core/sfm/estimate_poses.h"
#include "server/api/error.h"
#include "server/api/rows_to_proto.h"

namespace pepeseg {
namespace {

using Stage = v1::EstimateTrainingResponse::Stage;
using Metrics = std::map<std::string, double>;

// Decoding holds a photograph as it is, and undistorted, beside the capture.
constexpr int64_t kDecodingBytes = 16;  // a pixel

Metrics ParseMetrics(const std::string& text) {
  Metrics metrics;
  const auto json = nlohmann::json::parse(text, nullptr, /*allow_exceptions=*/false);
  if (!json.is_object()) return metrics;
  for (const auto& [name, value] : json.items()) {
    if (value.is_number()) metrics[name] = value.get<double>();
  }
  return metrics;
}

// A training that went through in one attempt, and how long it took.
struct Measured {
  v1::TrainingOptions options;
  Metrics metrics;
};

absl::StatusOr<std::optional<Measured>> FindMeasured(const ServiceContext& context,
                                                     const WantedTraining& training) {
  const std::string import = ToProto(training.settings).import().SerializeAsString();
  ASSIGN_OR_RETURN(const Page<ModelRow> models, context.store->ListModels(training.scene, {}));
  for (const ModelRow& model : models.rows) {
    if (model.device != context.backend->name()) continue;
    const auto job = context.store->GetJob(model.job);
    if (!job.ok() || job->dataset != training.dataset) continue;
    Measured measured;
    measured.metrics = ParseMetrics(model.metrics);
    const bool parsed = measured.options.ParseFromString(job->effective_options);
    const bool whole = !measured.metrics.contains("resumed_from_step");
    if (parsed && whole && measured.options.import().SerializeAsString() == import) return measured;
  }
  return std::optional<Measured>();
}

// `share`: steps wanted over steps measured.
void SetDuration(const std::optional<Measured>& measured, double share, Stage& stage) {
  if (!measured) return;
  const auto seconds = measured->metrics.find("seconds_" + stage.stage());
  if (seconds == measured->metrics.end() || !std::isfinite(seconds->second * share)) return;
  *stage.mutable_duration() = ToProto(absl::Seconds(seconds->second * share));
}

double StepShare(int wanted, int measured) {
  return static_cast<double>(wanted) / std::max(1, measured);
}

// Whether SAM makes the masks. Where a priors command fails it does, too: that is not expected.
bool MasksBySam(const ServiceContext& context, const PriorOptions& priors, bool has_masks) {
  if (!context.has_sam || has_masks) return false;
  return (priors.masks == PriorMaker::kAuto && !context.has_priors_command) ||
         AsksForSam(priors.masks);
}

// Other means are not timed before they have run.
void AddSam(const ServiceContext& context, const TrainingSize& size,
            v1::EstimateTrainingResponse& response) {
  Stage& priors = *response.add_stages();
  priors.set_stage("priors");
  priors.set_host_bytes(CaptureBytes(size) + SamHostBytes(context.num_threads));
  const double seconds = kSamCoreSeconds * static_cast<double>(size.num_views);
  *priors.mutable_duration() = ToProto(absl::Seconds(seconds / context.num_threads));
}

void AddStages(const ServiceContext& context, const TrainingSettings& settings,
               const DatasetSize& dataset, v1::EstimateTrainingResponse& response) {
  const TrainingSize& size = dataset.training;
  Stage& prepare = *response.add_stages();
  prepare.set_stage("prepare");
  prepare.set_host_bytes(CaptureBytes(size) + kDecodingBytes * dataset.max_source_pixels);

  const bool by_sam = MasksBySam(context, settings.priors, response.num_mask_files() > 0);
  if (!dataset.has_poses) {
    Stage& sfm = *response.add_stages();
    sfm.set_stage("sfm");
    // SAM runs next to COLMAP.
    sfm.set_host_bytes(SfmHostBytes(dataset.max_source_pixels, /*num_threads=*/0) +
                       (by_sam ? SamHostBytes(context.num_threads) : 0));
  }

  if (by_sam) {
    AddSam(context, size, response);
  }

  if (dataset.num_given_gaussians == 0) {
    const MemoryNeed need = EstimateReconstruct(*context.backend, size, settings.reconstruct);
    Stage& reconstruct = *response.add_stages();
    reconstruct.set_stage("reconstruct");
    reconstruct.set_device_bytes(need.device_bytes);
    reconstruct.set_host_bytes(need.host_bytes);
  }

  if (size.num_masked_views == 0) return;
  const bool given = dataset.num_given_gaussians > 0;
  const int64_t num_gaussians =
      given ? dataset.num_given_gaussians : MostGaussians(size, settings.reconstruct);
  const int sh_degree = given ? kMaxShDegree : settings.reconstruct.sh_degree;
  const ScratchSize scratch = TypicalScratch(num_gaussians, size.max_pixels);
  Stage& features = *response.add_stages();
  features.set_stage("features");
  features.set_device_bytes(
      FeatureDeviceBytes(*context.backend, scratch, sh_degree, settings.features));
  features.set_host_bytes(CaptureBytes(size) +
                          FeatureHostBytes(scratch, sh_degree, settings.features));
}

// What is made for every view counts as if it had been uploaded; the embedded depth takes no part
// in the reconstruction.
void ExpectPriors(const PriorOptions& priors, bool has_command, TrainingSize& size) {
  const bool by_command =
      has_command && (priors.depth == PriorMaker::kAuto || priors.depth == PriorMaker::kCommand);
  if (size.num_masked_views == 0 && priors.masks != PriorMaker::kNone) {
    size.num_masked_views = size.num_views;
  }
  if (size.num_depth_views == 0 && by_command) size.num_depth_views = size.num_views;
}

void SetDurations(const std::optional<Measured>& measured, const TrainingSettings& settings,
                  v1::EstimateTrainingResponse& response) {
  if (!measured) return;
  for (Stage& stage : *response.mutable_stages()) {
    double share = 1;
    if (stage.stage() == "reconstruct") {
      share =
          StepShare(settings.reconstruct.num_steps, measured->options.reconstruct().num_steps());
    } else if (stage.stage() == "features") {
      share = StepShare(settings.features.num_steps, measured->options.features().num_steps());
    }
    SetDuration(measured, share, stage);
  }
}

// A quarter more memory than the largest stage takes on the CPU, which is where a cluster counts
// it, and three times as long as all stages would take together: their limits end a job.
WorkerShare ShareOf(const v1::EstimateTrainingResponse& estimate) {
  constexpr int64_t kProgramBytes = int64_t{512} << 20;
  constexpr int64_t kStartSeconds = 600;
  WorkerShare share;
  bool timed = true;
  for (const Stage& stage : estimate.stages()) {
    const int64_t bytes = stage.host_bytes() + stage.device_bytes();
    share.host_bytes = std::max(share.host_bytes, bytes + bytes / 4 + kProgramBytes);
    timed &= stage.has_duration() || stage.stage() == "prepare";
    share.seconds += 3 * stage.duration().seconds();
  }
  share.seconds = timed ? share.seconds + kStartSeconds : 0;
  return share;
}

}  // namespace

absl::StatusOr<v1::EstimateTrainingResponse> EstimateTraining(const ServiceContext& context,
                                                              const WantedTraining& training,
                                                              CheckWanted wanted) {
  ASSIGN_OR_RETURN(DatasetSize dataset, MeasureDataset(context, training, wanted));
  v1::EstimateTrainingResponse response;
  response.set_num_mask_files(dataset.training.num_masked_views);
  ExpectPriors(training.settings.priors, context.has_priors_command, dataset.training);
  AddStages(context, training.settings, dataset, response);
  ASSIGN_OR_RETURN(const std::optional<Measured> measured, FindMeasured(context, training));
  SetDurations(measured, training.settings, response);
  response.set_device(context.backend->name());
  const bool one_memory = context.backend->memory().is_host;
  for (const Stage& stage : response.stages()) {
    const int64_t need = stage.device_bytes() + (one_memory ? stage.host_bytes() : 0);
    response.set_need_bytes(std::max(response.need_bytes(), need));
  }
  response.set_have_bytes(context.device_memory);
  response.set_num_views(dataset.training.num_views);
  response.set_max_pixels(dataset.training.max_pixels);
  response.set_num_points(dataset.training.num_points);
  return response;
}

absl::StatusOr<WorkerShare> CheckFits(const ServiceContext& context, const WantedTraining& training,
                                      CheckWanted wanted) {
  const auto estimate = EstimateTraining(context, training, wanted);
  RETURN_IF_ERROR(wanted());
  if (!estimate.ok()) return WorkerShare();
  if (estimate->need_bytes() <= estimate->have_bytes()) return ShareOf(*estimate);
  v1::ErrorDetail detail;
  detail.set_reason("DOES_NOT_FIT");
  detail.set_value(absl::StrCat(estimate->need_bytes(), " bytes"));
  detail.set_limit(absl::StrCat(estimate->have_bytes(), " bytes"));
  return WithDetail(absl::ResourceExhaustedError(absl::StrCat(
                        "the training needs up to ", estimate->need_bytes() >> 20, " MiB of ",
                        estimate->device(), ", ", estimate->have_bytes() >> 20,
                        " MiB are there: fewer max_gaussians or a smaller image_scale take less")),
                    detail);
}

}  // namespace pepeseg
