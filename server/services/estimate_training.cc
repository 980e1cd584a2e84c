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
#include "core/dataset/extra_files.h"
#include "core/dataset/held_out.h"
#include "core/dataset/video_frames.h"
#include "core/formats/movie_size.h"
#include "server/api/convert.h"
#include "server/api/error.h"
#include "server/services/file_header.h"
#include "server/services/segment_masks.h"
#include "server/worker_protocol/job_stage.h"

namespace pepeseg {
namespace {

// Headers read in one call, of photographs and of point files each.
constexpr size_t kMostHeaders = 48;
// Size of a frame of a video: frames are shrunk to 1600 pixels on the longer side.
constexpr int64_t kVideoFramePixels = 1600 * 1200;
// Points that the stage "sfm" finds for each photograph; measured: 215 for llff_fern, 234 for fox.
constexpr int64_t kPointsOfPhoto = 250;
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
absl::Status ReadSome(const ProjectBlobs& blobs, const std::vector<DatasetFileRow*>& files,
                      CheckWanted wanted, std::vector<DatasetFileRow>& read) {
  // Evenly spread over the list: photographs of one camera or one session lie next to each other.
  const size_t num_read = std::min(files.size(), kMostHeaders);
  for (size_t i = 0; i < num_read; ++i) {
    RETURN_IF_ERROR(wanted());
    DatasetFileRow& file = *files[i * files.size() / num_read];
    RETURN_IF_ERROR(ReadFileHeader(blobs.Path(file.sha256), file));
    read.push_back(file);
  }
  return absl::OkStatus();
}

// Reads headers that the store does not have, and stores what they say. They are missing
// for files whose bytes were there before their upload.
absl::Status ReadMissingHeaders(Store& store, const ProjectBlobs& blobs,
                                const WantedTraining& training, CheckWanted wanted,
                                std::vector<DatasetFileRow>& files) {
  std::vector<DatasetFileRow*> photos, points;
  for (DatasetFileRow& file : files) {
    if (file.header != HeaderState::kUnread || !HasHeader(file)) continue;
    (file.kind == v1::FILE_KIND_IMAGE ? photos : points).push_back(&file);
  }
  std::vector<DatasetFileRow> read;
  absl::Status status = ReadSome(blobs, photos, wanted, read);
  if (status.ok()) status = ReadSome(blobs, points, wanted, read);
  // Stored even if a later header failed or the call was cancelled, so that the next call does not
  // read them again.
  if (!read.empty()) {
    status.Update(store.files().SetFileHeaders(training.scene, training.dataset, read));
  }
  return status;
}

int64_t CountKind(const std::vector<DatasetFileRow>& files, v1::FileKind kind) {
  return std::count_if(files.begin(), files.end(),
                       [kind](const DatasetFileRow& file) { return file.kind == kind; });
}

// Removes the files that a training leaves out.
void LeaveOutExtraFiles(std::vector<DatasetFileRow>& files) {
  std::vector<std::string> names;
  names.reserve(files.size());
  for (const DatasetFileRow& file : files) names.push_back(file.path);
  const std::set<std::string> extra = ExtraFiles(names);
  std::erase_if(files, [&](const DatasetFileRow& file) { return extra.contains(file.path); });
}

// What the training options say about photographs: how they are shrunk, and how many frames the
// videos give.
struct PhotoRules {
  double image_scale;
  int64_t num_video_frames;  // that become photographs, of all videos together
};

// Returns how many frames of the videos become photographs, and adds all that they have to `size`.
int64_t MeasureVideos(const ProjectBlobs& blobs, const std::vector<DatasetFileRow>& files,
                      int64_t max_frames, DatasetSize& size) {
  int64_t num_photos = 0;
  for (const DatasetFileRow& file : files) {
    if (file.kind != v1::FILE_KIND_VIDEO) continue;
    const MovieSize movie = ReadMovieSize(blobs.Path(file.sha256));
    num_photos += ExpectedFrames(movie.num_frames, max_frames);
    size.video_megapixels +=
        1e-6 * static_cast<double>(movie.num_frames) * movie.width * movie.height;
  }
  return num_photos;
}

// Sums the pixels of all views. Photographs whose header was not read count with the mean of the
// others; a refused one is an error that names it.
absl::Status MeasurePhotos(const ProjectBlobs& blobs, const std::vector<DatasetFileRow>& files,
                           const PhotoRules& rules, DatasetSize& size) {
  std::vector<const DatasetFileRow*> photos;
  for (const DatasetFileRow& file : files) {
    if (file.kind == v1::FILE_KIND_IMAGE) photos.push_back(&file);
  }
  if (photos.empty() && rules.num_video_frames == 0) {
    return absl::InvalidArgumentError("the dataset has no photograph");
  }
  int64_t sum = 0;
  int64_t num_known = 0;
  for (const DatasetFileRow* photo : photos) {
    if (photo->header == HeaderState::kRefused) return RefusalOf(blobs.Path(photo->sha256), *photo);
    if (photo->header == HeaderState::kUnread) continue;
    const int64_t pixels = int64_t{photo->width} * photo->height;
    sum += pixels;
    ++num_known;
    size.max_source_pixels = std::max(size.max_source_pixels, pixels);
  }
  if (rules.num_video_frames > 0) {
    size.max_source_pixels = std::max(size.max_source_pixels, kVideoFramePixels);
  }
  // `image_scale` shrinks both sides, so the pixels shrink by its square.
  const auto scaled = [&rules](double pixels) {
    return static_cast<int64_t>(std::ceil(pixels * rules.image_scale * rules.image_scale));
  };
  const double mean =
      static_cast<double>(sum) / static_cast<double>(std::max<int64_t>(1, num_known));
  const auto video_pixels = static_cast<double>(rules.num_video_frames * kVideoFramePixels);
  TrainingSize& training = size.training;
  training.num_views = static_cast<int64_t>(photos.size()) + rules.num_video_frames;
  training.num_pixels = scaled(mean * static_cast<double>(photos.size()) + video_pixels);
  training.max_pixels = scaled(static_cast<double>(size.max_source_pixels));
  return absl::OkStatus();
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

// Returns the newest such training of the dataset on this device with the same import options.
absl::StatusOr<std::optional<Measured>> FindMeasured(Store& store, const std::string& device,
                                                     const WantedTraining& training) {
  // The import options decide which files count, and the size of the images. Other options may
  // differ: SetDurations scales by their expected times.
  const std::string import = ToProto(training.settings).import().SerializeAsString();
  // The first page: the newest 50 models. An older measurement is not worth more reads.
  ASSIGN_OR_RETURN(const Page<ModelRow> models, store.models().ListModels(training.scene, {}));
  for (const ModelRow& model : models.rows) {
    if (model.device != device) continue;
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
  ASSIGN_OR_RETURN(std::vector<DatasetFileRow> files,
                   store.files().ListDatasetFiles(training.scene, training.dataset));
  LeaveOutExtraFiles(files);
  const std::string& project = training.scene.project;
  const ProjectBlobs blobs{blob_store, project};
  RETURN_IF_ERROR(ReadMissingHeaders(store, blobs, training, wanted, files));
  const ImportOptions& import = training.settings.import;
  DatasetSize size;
  const PhotoRules rules{import.image_scale,
                         MeasureVideos(blobs, files, training.settings.sfm.max_video_frames, size)};
  RETURN_IF_ERROR(MeasurePhotos(blobs, files, rules, size));
  size.has_poses = CountKind(files, v1::FILE_KIND_POSES) > 0;
  size.is_video = CountKind(files, v1::FILE_KIND_IMAGE) == 0;
  TrainingSize& counts = size.training;
  const int64_t held_out = NumHeldOut(import, counts.num_views);
  counts.num_training_views = std::max<int64_t>(1, counts.num_views - held_out);
  // Names are not matched here, so a view may have several files or none; the number of views
  // bounds the count.
  const int64_t num_masks = CountKind(files, v1::FILE_KIND_MASK);
  const int64_t num_segment_masks =
      num_masks > 0 ? CountSegmentMasks(blob_store, project, files) : 0;
  if (import.use_masks) counts.num_masked_views = std::min(counts.num_views, num_segment_masks);
  // One ignore mask may apply to all views. Masks without segments are ignore masks.
  if (CountKind(files, v1::FILE_KIND_IGNORE_MASK) > 0 || num_segment_masks < num_masks) {
    counts.num_ignore_views = counts.num_views;
  }
  if (import.use_depth) {
    counts.num_depth_views =
        std::min(counts.num_views,
                 CountKind(files, v1::FILE_KIND_DEPTH) + CountKind(files, v1::FILE_KIND_DISPARITY));
  }
  for (const DatasetFileRow& file : files) {
    int64_t& most =
        file.kind == v1::FILE_KIND_GAUSSIANS ? size.num_given_gaussians : counts.num_points;
    most = std::max(most, file.num_points);
  }
  // Without poses, the stage "sfm" finds the points.
  if (!size.has_poses) counts.num_points = kPointsOfPhoto * counts.num_views;
  return size;
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
  response.set_have_bytes(machine_.device_memory);
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
