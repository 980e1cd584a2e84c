#pragma once

#include <random>

#include "absl/status/status.h"
#include "core/reconstruct/gaussian_state.h"
#include "core/reconstruct/reconstruct.h"

namespace pepeseg {

// Adaptive density control (Kerbl et al. 2023): when it is due, and its effect on the state. Steps
// count from 0 and are told after their update.
class Densifier {
 public:
  Densifier(Backend& backend, const ReconstructOptions& options, double scene_radius)
      : backend_(backend), options_(options), scene_radius_(scene_radius) {}

  bool Due(int step) const;
  bool OpacityResetDue(int step) const;

  // RESOURCE_EXHAUSTED when the backend is out of memory, FAILED_PRECONDITION when no Gaussian is
  // left.
  absl::Status Apply(GaussianState& state, std::mt19937_64& random) const;

 private:
  // What is to be done every `every` steps, between the two shares of the run.
  bool IsEvery(int every, int step) const;

  Backend& backend_;
  ReconstructOptions options_;
  double scene_radius_;
};

}  // namespace pepeseg
