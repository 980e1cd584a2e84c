#pragma once

#include <random>

#include "absl/status/status.h"
#include "core/reconstruct/gaussian_state.h"
#include "core/reconstruct/reconstruct.h"

namespace pepeseg {

// What density control must know of a scene.
struct DensityScene {
  double radius = 1;  // scene units, see SceneRadius
  int64_t num_training_pixels = 0;
  int64_t num_initial = 0;  // Gaussians
};

// Adaptive density control (Kerbl et al. 2023): when it is due, and its effect on the state. Steps
// count from 0 and are told after their update.
class Densifier {
 public:
  Densifier(Backend& backend, const ReconstructOptions& options, const DensityScene& scene)
      : backend_(backend), options_(options), scene_(scene) {}

  bool Due(int step) const;
  bool OpacityResetDue(int step) const;

  // How many Gaussians there may be after the round of this step.
  int64_t BudgetAt(int step) const;

  // RESOURCE_EXHAUSTED when the backend is out of memory, FAILED_PRECONDITION when no Gaussian is
  // left.
  absl::Status Apply(int step, GaussianState& state, std::mt19937_64& random) const;

 private:
  bool budgeted() const { return options_.pixels_per_gaussian > 0; }
  // What is to be done every `every` steps, between the two shares of the run.
  bool IsEvery(int every, int step) const;

  Backend& backend_;
  ReconstructOptions options_;
  DensityScene scene_;
};

}  // namespace pepeseg
