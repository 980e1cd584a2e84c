#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "core/model_files/checkpoint.h"

namespace pepeseg {

// State of a BatchDrawer.
struct DrawerState {
  std::string random;               // std::mt19937_64 as text, see StateOf
  std::vector<int32_t> views_left;  // not yet drawn in this round
};

// State of a CentroidTerm.
struct CentroidState {
  std::string random;               // as in DrawerState
  std::vector<float> upper, lower;  // [K, 32] centroids of each scale
};

// Features and gate with the state of their optimiser, see FeatureState.
struct FeatureRowsState {
  std::vector<float> features, moment1, moment2;        // [N, 32]
  std::vector<int32_t> last_step;                       // [N]
  std::vector<float> gate, gate_moment1, gate_moment2;  // [kGateSize] or [kTwoLayerGateSize]
};

// Everything that a step of stage two depends on, except for the capture, the Gaussians and the
// options. A stage resumes from it as if it had never stopped; on the CPU it ends with the same
// bytes.
//
// A new member must be added to VisitSections in checkpoint.cc, and saved and restored by
// FeatureTrainer.
struct FeatureCheckpoint {
  struct Counters {
    int64_t step = 0;            // steps done
    int64_t steps_of_chunk = 0;  // steps done of the current chunk, which begins at `drawer`
    int64_t num_gaussians = 0;
    // Number of steps of the schedule that are left out, and the step after which that was decided.
    int64_t num_left_out = 0, left_out_after = 0;
  };
  Counters counters;
  std::vector<double> losses;  // Convergence::State: sum, num, before
  DrawerState drawer;          // before the current chunk
  CentroidState centroids;
  FeatureRowsState rows;

  // Reads a checkpoint from its sections. DATA_LOSS: a section is missing, unknown, of another
  // version or of a size that does not fit, or a number is not finite.
  static absl::StatusOr<FeatureCheckpoint> Read(std::span<const CheckpointSection> sections);
};

// Returns the sections to write. They refer to the checkpoint's memory.
std::vector<CheckpointSection> SectionsOf(const FeatureCheckpoint& checkpoint);

// Returns DATA_LOSS if a counter is out of range, sizes disagree, or a number is not finite.
absl::Status Validate(const FeatureCheckpoint& checkpoint);

}  // namespace pepeseg
