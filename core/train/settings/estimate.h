#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "absl/status/statusor.h"
#include "core/dataset/dataset_files.h"
#include "core/reconstruct/estimate.h"
#include "core/train/settings/stage_plan.h"
#include "core/train/settings/training_settings.h"
#include "kernels/backend.h"

namespace pepeseg {

// Size of a dataset, known from the headers of its files.
struct DatasetSize {
  TrainingSize training;
  int64_t max_source_pixels = 0;  // pixels of the largest photograph, as uploaded
  bool has_poses = false;         // false: stage "sfm" estimates them
  bool is_video = false;          // all photographs are frames of videos
  // Frames of the videos times their pixels, all of which stage "prepare" reads. 0: no videos, or
  // their length is not known.
  double video_megapixels = 0;
  int64_t num_given_gaussians = 0;  // Gaussians given instead of stage one's. 0: none
};

// A file of a dataset and its header. Nothing is known of a header that was not read.
struct MeasuredFile {
  DatasetFile file;
  FileFacts facts;
};

// Returns the size of a dataset of these files, without ExtraFiles. Photographs whose header was
// not read count with the mean of the others, and a video as the frames that are taken from it, at
// a usual size; reads the headers of videos. Files are not matched by name: a view may have several
// masks or none. INVALID_ARGUMENT: there is no photograph.
absl::StatusOr<DatasetSize> SizeOf(std::span<const MeasuredFile> files, int64_t num_segment_masks,
                                   const TrainingSettings& settings);

// Properties of the machine that change the estimate.
struct EstimateTools {
  bool has_priors_command = false;
  bool has_sam = false;
  bool has_lpips = false;
  int num_threads = 1;
  // Bytes that a training may take of the device's memory. 0: not known.
  int64_t device_memory = 0;
};

// Memory and time that a stage needs.
struct StageNeed {
  Stage stage = Stage::kPrepare;
  // Upper estimates; 0 for stages that need less than others before them.
  int64_t host_bytes = 0;
  int64_t device_bytes = 0;  // allocated by Backend::Allocate
  std::optional<double> seconds =
      {};  // expected, see PlanStages. Absent: unknown before it has run
};

// Returns what PlanStages needs to know of a dataset.
TrainingFacts FactsOf(const Backend& backend, const DatasetSize& dataset,
                      const TrainingSettings& settings, const EstimateTools& tools);

// Returns what the stages take, in the order in which they run. Masks and depth that a training
// will make count as if they were in the dataset.
std::vector<StageNeed> EstimateStages(const Backend& backend, DatasetSize dataset,
                                      const TrainingSettings& settings, const EstimateTools& tools);

}  // namespace pepeseg
