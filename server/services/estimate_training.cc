#include "server/services/estimate_training.h"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <optional>
#include <vector>

#include "absl/strings/str_cat.h"
#include "core/base/status_macros.h"
#include "core/train/estimate.h"
#include "server/api/error.h"
#include "server/api/rows_to_proto.h"

namespace pepeseg {
namespace {

using Stage = v1::EstimateTrainingResponse::Stage;
using Metrics = std::map<std::string, double>;

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
  ASSIGN_OR_RETURN(const Page<ModelRow> models,
                   context.store->models().ListModels(training.scene, {}));
  for (const ModelRow& model : models.rows) {
    if (model.device != context.backend->name()) continue;
    const auto job = context.store->jobs().GetJob(model.job);
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

void AddStages(const ServiceContext& context, const TrainingSettings& settings,
               const DatasetSize& dataset, v1::EstimateTrainingResponse& response) {
  const EstimateTools tools{context.has_priors_command, context.has_sam, context.num_threads};
  for (const StageNeed& need : EstimateStages(*context.backend, dataset, settings, tools)) {
    Stage& stage = *response.add_stages();
    stage.set_stage(need.stage);
    stage.set_host_bytes(need.host_bytes);
    stage.set_device_bytes(need.device_bytes);
    if (need.seconds) *stage.mutable_duration() = ToProto(absl::Seconds(*need.seconds));
  }
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
  ASSIGN_OR_RETURN(const DatasetSize dataset, MeasureDataset(context, training, wanted));
  v1::EstimateTrainingResponse response;
  response.set_num_mask_files(dataset.training.num_masked_views);
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
