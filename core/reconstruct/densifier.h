#pragma once

#include <random>

#include "absl/status/status.h"
#include "core/reconstruct/gaussian_state.h"
#include "core/reconstruct/options.h"

namespace pepeseg {

// Properties of a scene that density control depends on.
struct DensityScene {
  double radius = 1;                // scene units, see SceneRadius
  int64_t num_training_pixels = 0;  // of all training photographs
  int64_t num_initial = 0;          // Gaussians at the start
};

// Adaptive density control (Kerbl et al. 2023; METHOD.md section 1, "Density"): when it is due, and
// its effect on the state. `step` is the schedule position, from 0, of a step whose update is done.
class Densifier {
 public:
  Densifier(Backend& backend, const ReconstructOptions& options, const DensityScene& scene)
      : backend_(backend), options_(options), scene_(scene) {}

  bool Due(int step) const;
  bool OpacityResetDue(int step) const;

  // Returns the maximum number of Gaussians after the round of this step: linear between the number
  // at the start and the budget, or max_gaussians where there is no budget.
  int64_t BudgetAt(int step) const;

  // Returns the standard deviation, in scene units, above which the round of this step prunes. 0:
  // no such limit.
  float MaxSizeAt(int step) const;

  // Does one round: prunes, clones and splits, and fades the opacities where there is a budget.
  // `has_depth`: a depth loss is in effect. A parent that is split then never stays, because that
  // cost several dB in single views (tests/bench/results/peak_quality.md). Waits for the backend.
  // Returns RESOURCE_EXHAUSTED when it is out of memory and FAILED_PRECONDITION when no Gaussian is
  // left.
  absl::Status Apply(int step, bool has_depth, GaussianState& state, std::mt19937_64& random) const;

 private:
  bool budgeted() const { return options_.pixels_per_gaussian > 0; }
  // True every `every` steps between densify_from and densify_until.
  bool IsEvery(int every, int step) const;

  Backend& backend_;
  ReconstructOptions options_;
  DensityScene scene_;
};

}  // namespace pepeseg
