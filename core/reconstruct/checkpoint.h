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

// Everything that GaussianTrainer::Step depends on besides the capture and the options. Stage one
// resumes from it as if it had never stopped, on the CPU with the same bytes as a result.
//
// A new member must be visited in checkpoint.cc, and saved and restored by GaussianTrainer.
// A section whose layout or meaning changes gets the next version there.
struct GaussianCheckpoint {
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
  std::string random;               // std::mt19937_64 as text, see StateOf
  std::vector<int32_t> views_left;  // ViewSampler::left
  GaussianRows gaussians;

  // Reads a checkpoint from its sections. Returns DATA_LOSS when a section is missing, unknown, of
  // another version or of a wrong size, or where Validate fails.
  static absl::StatusOr<GaussianCheckpoint> Read(std::span<const CheckpointSection> sections);
};

// Returns the sections of the checkpoint's file. They point into `checkpoint`, which must outlive
// them.
std::vector<CheckpointSection> SectionsOf(const GaussianCheckpoint& checkpoint);

// Returns DATA_LOSS when counters are out of range, sizes disagree or a number is not finite.
absl::Status Validate(const GaussianCheckpoint& checkpoint);

}  // namespace pepeseg
