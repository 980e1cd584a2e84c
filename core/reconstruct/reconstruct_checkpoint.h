#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "core/model_files/checkpoint.h"
#include "core/reconstruct/gaussian_state.h"

namespace pepeseg {

// Everything that Reconstructor::Step depends on beside the capture and the options: stage one goes
// on from it as if it had never stopped, on the CPU to the same bytes.
//
// What is added here has to be visited in reconstruct_checkpoint.cc and restored in
// Reconstructor::Resume; a section whose layout or meaning changes gets the next version there.
struct ReconstructCheckpoint {
  struct Counters {
    int64_t step = 0;  // done
    int64_t num_culled_degenerate = 0;
    int64_t num_skipped_gradients = 0;
    int64_t num_void_renders = 0;
    int64_t num_refined = 0;
    int64_t num_refine_split = 0;
    int64_t num_skipped_depths = 0;
    int64_t place = 0;              // in the schedule: steps done and left out
    int64_t depth_is_left_out = 0;  // 1: since it was found not to agree
  };
  Counters counters;
  std::vector<double> needs;        // SceneNeeds::Save
  std::string random;               // std::mt19937_64 as it writes itself
  std::vector<int32_t> views_left;  // ViewSampler's
  GaussianRows gaussians;
};

// Borrows the checkpoint's memory.
std::vector<CheckpointSection> SectionsOf(const ReconstructCheckpoint& checkpoint);

// DATA_LOSS: a section is missing, unknown, of another version or of a size that does not fit, or
// a number is not finite.
absl::StatusOr<ReconstructCheckpoint> ReconstructCheckpointOf(
    std::span<const CheckpointSection> sections);

// DATA_LOSS: sizes that disagree, or a number that is not finite: nothing to go on from.
absl::Status Validate(const ReconstructCheckpoint& checkpoint);

}  // namespace pepeseg
