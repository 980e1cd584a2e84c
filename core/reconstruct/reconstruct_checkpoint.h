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

// Everything that Reconstructor::Step depends on besides the capture and the options. Stage one
// resumes from it as if it had never stopped, on the CPU with the same bytes as a result.
//
// A new member must be visited in reconstruct_checkpoint.cc and restored by Reconstructor::Resume.
// A section whose layout or meaning changes gets the next version there.
struct ReconstructCheckpoint {
  struct Counters {
    int64_t step = 0;  // steps done
    int64_t num_culled_degenerate = 0;
    int64_t num_skipped_gradients = 0;
    int64_t num_overflowed_renders = 0;
    int64_t num_refined = 0;
    int64_t num_refine_split = 0;
    int64_t num_skipped_depths = 0;
    int64_t position = 0;           // schedule position: steps done and skipped
    int64_t depth_is_left_out = 0;  // 1: the depth loss was dropped, see DepthAgreement
  };
  Counters counters;
  std::vector<double> needs;        // SceneNeeds::Save
  std::string random;               // std::mt19937_64 in its text form
  std::vector<int32_t> views_left;  // ViewSampler::left
  GaussianRows gaussians;
};

// Returns the sections of the checkpoint's file. They point into `checkpoint`, which must outlive
// them.
std::vector<CheckpointSection> SectionsOf(const ReconstructCheckpoint& checkpoint);

// Reads a checkpoint from its sections. Returns DATA_LOSS when a section is missing, unknown, of
// another version or of a wrong size, or where Validate fails.
absl::StatusOr<ReconstructCheckpoint> ReconstructCheckpointOf(
    std::span<const CheckpointSection> sections);

// Returns DATA_LOSS when counters are out of range, sizes disagree or a number is not finite.
absl::Status Validate(const ReconstructCheckpoint& checkpoint);

}  // namespace pepeseg
