#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "core/model_files/checkpoint.h"

namespace pepeseg {

// Where a BatchDrawer stands.
struct DrawerState {
  std::string random;               // std::mt19937_64 as it writes itself
  std::vector<int32_t> views_left;  // of the round
};

// What the centroid term has gathered.
struct CentroidState {
  std::string random;
  std::vector<float> upper, lower;  // [K, 32] centroids
};

// Features and gate with their optimiser.
struct FeatureRowsState {
  std::vector<float> features, moment1, moment2;  // [N, 32]
  std::vector<int32_t> last_step;                 // [N]
  std::vector<float> gate, gate_moment1, gate_moment2;
};

// Everything that a step of stage two depends on beside the capture, the Gaussians and the options:
// the stage goes on from it as if it had never stopped, on the CPU to the same bytes.
//
// What is added here has to be visited in feature_checkpoint.cc and restored in FeatureStage.
struct FeatureCheckpoint {
  struct Counters {
    int64_t step = 0;            // done
    int64_t steps_of_chunk = 0;  // of these, since the drawer stood at `drawer`
    int64_t num_gaussians = 0;
    // Steps of the schedule that are left out, and after which step that was decided.
    int64_t num_left_out = 0, left_out_after = 0;
  };
  Counters counters;
  std::vector<double> losses;  // Convergence's: sum, number, mean of the window before
  DrawerState drawer;          // before the chunk that was being trained
  CentroidState centroids;
  FeatureRowsState rows;
};

// Borrows the checkpoint's memory.
std::vector<CheckpointSection> SectionsOf(const FeatureCheckpoint& checkpoint);

// DATA_LOSS: a section is missing, unknown, of another version or of a size that does not fit, or
// a number is not finite.
absl::StatusOr<FeatureCheckpoint> FeatureCheckpointOf(std::span<const CheckpointSection> sections);

// DATA_LOSS: sizes that disagree, or a number that is not finite: nothing to go on from.
absl::Status Validate(const FeatureCheckpoint& checkpoint);

}  // namespace pepeseg
