#include "server/services/estimate_training.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "core/base/status_macros.h"
#include "server/api/convert.h"
#include "server/api/error.h"
#include "server/services/file_header.h"
#include "server/worker_protocol/device.h"
#include "server/worker_protocol/job_stage.h"

namespace pepeseg {
namespace {

// Headers read in one call, of photographs and of point files each.
constexpr size_t kMostHeaders = 48;
// Maximum time of a stage that is believed, seconds: the time limit of a job is far below it.
constexpr double kMostSeconds = 1e7;

// Where the bytes of a project's files are.
struct ProjectBlobs {
  const BlobStore& store;
  std::string project;
  std::filesystem::path Path(const std::string& sha256) const {
    return store.Path({project, sha256});
  }
};

// Reads up to kMostHeaders of the files' headers, evenly spread, and adds those files to `read`.
absl::Status ReadSome(const ProjectBlobs& blobs, const std::vector<DatasetFileRecord*>& files,
                      CheckWanted wanted, std::vector<DatasetFileRecord>& read) {
  // Evenly spread over the list: photographs of one camera or one session lie next to each other.
  const size_t num_read = std::min(files.size(), kMostHeaders);
  for (size_t i = 0; i < num_read; ++i) {
    RETURN_IF_ERROR(wanted());
    DatasetFileRecord& file = *files[i * files.size() / num_read];
    RETURN_IF_ERROR(ReadFileHeader(blobs.Path(file.sha256), file));
    read.push_back(file);
  }
  return absl::OkStatus();
}

// Reads headers that the store does not have, and stores what they say. They are missing
// for files whose bytes were there before their upload.
absl::Status ReadMissingHeaders(Store& store, const ProjectBlobs& blobs,
                                const WantedTraining& training, CheckWanted wanted,
                                std::vector<DatasetFileRecord>& files) {
  std::vector<DatasetFileRecord*> photos, points;
  for (DatasetFileRecord& file : files) {
    if (file.header != HeaderState::kUnread || !HasHeader(file)) continue;
    (file.kind == v1::FILE_KIND_IMAGE ? photos : points).push_back(&file);
  }
  std::vector<DatasetFileRecord> read;
  absl::Status status = ReadSome(blobs, photos, wanted, read);
  if (status.ok()) status = ReadSome(blobs, points, wanted, read);
  // Stored even if a later header failed or the call was cancelled, so that the next call does not
  // read them again.
  if (!read.empty()) {
    status.Update(store.files().SetFileHeaders(training.scene, training.dataset, read));
  }
  return status;
}

// Removes the files that a training leaves out.
void LeaveOutExtraFiles(std::vector<DatasetFileRecord>& files) {
  std::vector<std::string> names;
  names.reserve(files.size());
  for (const DatasetFileRecord& file : files) names.push_back(file.path);
  const std::set<std::string> extra = ExtraFiles(names);
  std::erase_if(files, [&](const DatasetFileRecord& file) { return extra.contains(file.path); });
}

using Metrics = std::map<std::string, double>;

// Returns the numbers among a model's metrics. Text that is not JSON has none: an estimate without
// durations is better than no estimate.
Metrics ParseMetrics(const std::string& text) {
  Metrics metrics;
  const auto json = nlohmann::json::parse(text, nullptr, /*allow_exceptions=*/false);
  if (!json.is_object()) return metrics;
  for (const auto& [name, value] : json.items()) {
    if (value.is_number()) metrics[name] = value.get<double>();
  }
  return metrics;
}

// A training that succeeded in one attempt, and how long its stages took.
struct Measured {
  TrainingSettings settings;
  Metrics metrics;
};

// Returns the newest such training of the dataset on a device of this kind with the same import
// options.
absl::StatusOr<std::optional<Measured>> FindMeasured(Store& store, const std::string& device,
                                                     const WantedTraining& training) {
  // The import options decide which files count, and the size of the images. Other options may
  // differ: SetDurations scales by their expected times.
  const std::string import = ToProto(training.settings).import().SerializeAsString();
  // The first page: the newest 50 models. An older measurement is not worth more reads.
  ASSIGN_OR_RETURN(const Page<ModelRecord> models, store.models().ListModels(training.scene, {}));
  for (const ModelRecord& model : models.records) {
    if (KindOfDevice(model.device) != KindOfDevice(device)) continue;
    const auto job = store.jobs().GetJob(model.job);
    if (!job.ok() || job->dataset != training.dataset) continue;
    Metrics metrics = ParseMetrics(model.metrics);
    // A resumed attempt has measured only the steps after its checkpoint.
    if (metrics.contains("resumed_from_step")) continue;
    v1::TrainingOptions options;
    if (!options.ParseFromString(job->effective_options)) continue;
    if (options.import().SerializeAsString() != import) continue;
    const auto settings = TrainingSettingsFromProto(options);
    if (settings.ok()) return Measured{*settings, std::move(metrics)};
  }
  return std::optional<Measured>();
}

// Replaces expected seconds by those that a training measured, times the ratio of what is expected
// of both: `expected_then` of the measured one. Returns whether all stages that take long were
// measured.
bool UseMeasured(const Metrics& metrics, const std::vector<StageNeed>& expected_then,
                 std::vector<StageNeed>& needs) {
  std::map<Stage, double> then;
  for (const StageNeed& need : expected_then) {
    if (need.seconds) then[need.stage] = *need.seconds;
  }
  bool all = true;
  for (StageNeed& need : needs) {
    const auto measured = metrics.find(absl::StrCat("seconds_", NameOf(need.stage)));
    if (measured == metrics.end() || !std::isfinite(measured->second)) {
      all &= need.stage == Stage::kPrepare || need.stage == Stage::kEvaluate ||
             need.stage == Stage::kIndex;
      continue;
    }
    const double expected = then.contains(need.stage) ? then[need.stage] : 0;
    const double ratio = expected > 0 && need.seconds ? *need.seconds / expected : 1;
    need.seconds = ratio * std::clamp(measured->second, 0.0, kMostSeconds);
  }
  return all;
}

void AddStages(const std::vector<StageNeed>& needs, v1::EstimateTrainingResponse& response) {
  double sum = 0;
  bool all_known = true;
  for (const StageNeed& need : needs) {
    v1::EstimateTrainingResponse::Stage& stage = *response.add_stages();
    stage.set_stage(ToProto(need.stage));
    stage.set_host_bytes(need.host_bytes);
    stage.set_device_bytes(need.device_bytes);
    if (need.seconds) *stage.mutable_duration() = ToProto(absl::Seconds(*need.seconds));
    all_known &= need.seconds.has_value();
    sum += need.seconds.value_or(0);
  }
  if (all_known) *response.mutable_duration() = ToProto(absl::Seconds(sum));
}

// Returns a quarter more memory than the largest stage takes, on host and device together, as if
// the device were the CPU: a cluster limits the worker's memory. Also returns three times the
// duration of all stages if it was measured on this machine: a cluster ends a job that exceeds its
// limits.
WorkerShare ShareOf(const v1::EstimateTrainingResponse& estimate, bool is_measured) {
  constexpr int64_t kProgramBytes = int64_t{512} << 20;
  constexpr int64_t kStartSeconds = 600;
  WorkerShare share;
  for (const auto& stage : estimate.stages()) {
    const int64_t bytes = stage.host_bytes() + stage.device_bytes();
    share.host_bytes = std::max(share.host_bytes, bytes + bytes / 4 + kProgramBytes);
  }
  if (is_measured) share.seconds = 3 * estimate.duration().seconds() + kStartSeconds;
  return share;
}

}  // namespace

absl::StatusOr<DatasetSize> MeasureDataset(Store& store, const BlobStore& blob_store,
                                           const WantedTraining& training, CheckWanted wanted) {
  ASSIGN_OR_RETURN(std::vector<DatasetFileRecord> files,
                   store.files().ListDatasetFiles(training.scene, training.dataset));
  LeaveOutExtraFiles(files);
  const ProjectBlobs blobs{blob_store, training.scene.project};
  RETURN_IF_ERROR(ReadMissingHeaders(store, blobs, training, wanted, files));
  std::vector<MeasuredFile> measured;
  bool has_masks = false;
  for (const DatasetFileRecord& record : files) {
    const std::filesystem::path blob = blobs.Path(record.sha256);
    if (record.kind == v1::FILE_KIND_IMAGE && record.header == HeaderState::kRefused) {
      return RefusalOf(blob, record);
    }
    has_masks |= record.kind == v1::FILE_KIND_MASK;
    measured.push_back(
        {StoredFile(record, blob), {record.width, record.height, record.num_points}});
  }
  const int64_t num_segment_masks =
      has_masks ? CountSegmentMasks(blob_store, blobs.project, files) : 0;
  return SizeOf(measured, num_segment_masks, training.settings);
}

absl::StatusOr<TrainingEstimator::Estimated> TrainingEstimator::EstimateAll(
    const WantedTraining& training, CheckWanted wanted) const {
  const Backend& backend = machine_.backend;
  ASSIGN_OR_RETURN(const DatasetSize dataset, MeasureDataset(store_, blobs_, training, wanted));
  Estimated estimated;
  v1::EstimateTrainingResponse& response = estimated.response;
  response.set_num_mask_files(dataset.training.num_masked_views);
  std::vector<StageNeed> needs =
      EstimateStages(backend, dataset, training.settings, machine_.tools);
  ASSIGN_OR_RETURN(const std::optional<Measured> measured,
                   FindMeasured(store_, backend.name(), training));
  if (measured) {
    const auto then = EstimateStages(backend, dataset, measured->settings, machine_.tools);
    estimated.is_measured = UseMeasured(measured->metrics, then, needs);
  }
  AddStages(needs, response);
  response.set_device(backend.name());
  const bool one_memory = backend.memory().is_host;
  for (const auto& stage : response.stages()) {
    // Stages run one after the other, so the largest counts. On a device that is the host both
    // kinds come out of the same memory.
    const int64_t need = stage.device_bytes() + (one_memory ? stage.host_bytes() : 0);
    response.set_need_bytes(std::max(response.need_bytes(), need));
  }
  response.set_have_bytes(machine_.tools.device_memory);
  response.set_num_views(dataset.training.num_views);
  response.set_max_pixels(dataset.training.max_pixels);
  response.set_num_points(dataset.training.num_points);
  return estimated;
}

absl::StatusOr<v1::EstimateTrainingResponse> TrainingEstimator::Estimate(
    const WantedTraining& training, CheckWanted wanted) const {
  ASSIGN_OR_RETURN(Estimated estimated, EstimateAll(training, wanted));
  return std::move(estimated.response);
}

absl::StatusOr<WorkerShare> TrainingEstimator::CheckFits(const WantedTraining& training,
                                                         CheckWanted wanted) const {
  // A caller who is gone gets its own error, which Estimate may have returned as one of many.
  const auto estimated = EstimateAll(training, wanted);
  RETURN_IF_ERROR(wanted());
  if (!estimated.ok()) return WorkerShare();
  const v1::EstimateTrainingResponse& estimate = estimated->response;
  if (estimate.need_bytes() <= estimate.have_bytes()) {
    return ShareOf(estimate, estimated->is_measured);
  }
  return WithDetail(absl::ResourceExhaustedError(absl::StrCat(
                        "the training needs up to ", estimate.need_bytes() >> 20, " MiB of ",
                        estimate.device(), ", ", estimate.have_bytes() >> 20,
                        " MiB are there: fewer max_gaussians or a smaller image_scale take less")),
                    {.reason = "DOES_NOT_FIT",
                     .limit = absl::StrCat(estimate.have_bytes(), " bytes"),
                     .value = absl::StrCat(estimate.need_bytes(), " bytes")});
}

}  // namespace pepeseg
