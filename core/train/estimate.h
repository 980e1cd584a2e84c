#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "core/reconstruct/estimate.h"
#include "core/train/training_settings.h"
#include "kernels/backend.h"

namespace pepeseg {

// Size of a dataset, known from the headers of its files.
struct DatasetSize {
  TrainingSize training;
  int64_t max_source_pixels = 0;    // pixels of the largest photograph, as uploaded
  bool has_poses = false;           // false: stage "sfm" estimates them
  // Frames of the videos times their pixels, all of which stage "prepare" reads. 0: no videos, or
  // their length is not known.
  double video_megapixels = 0;
  int64_t num_given_gaussians = 0;  // Gaussians given instead of stage one's. 0: none
};

// Properties of the machine that change the estimate.
struct EstimateTools {
  bool has_priors_command = false;
  bool has_sam = false;
  int num_threads = 1;
};

// Upper estimate of what a stage takes.
struct StageNeed {
  std::string stage = {};
  int64_t host_bytes = 0;
  int64_t device_bytes = 0;            // allocated by Backend::Allocate
  std::optional<double> seconds = {};  // absent: unknown before it has run
};

// Returns upper estimates for the stages that need a notable amount of memory, in the order in
// which they run. Masks and depth that a training will make count as if they were in the dataset.
std::vector<StageNeed> EstimateStages(const Backend& backend, DatasetSize dataset,
                                      const TrainingSettings& settings, const EstimateTools& tools);

}  // namespace pepeseg
