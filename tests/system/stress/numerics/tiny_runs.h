#pragma once

#include <memory>
#include <optional>
#include <vector>

#include "absl/status/statusor.h"
#include "core/features/train_features.h"
#include "core/reconstruct/reconstruct.h"
#include "core/scene/capture.h"
#include "core/scene/model.h"
#include "kernels/backend.h"
#include "tests/kernels/backend_test.h"
#include "tests/testing/synthetic_capture.h"

// The stages on scenes so small that many runs of them, or very long ones, cost seconds; and what
// must hold of every run, whatever it was given.

namespace pepeseg::testing {

struct TinyOptions {
  int num_views = 9;
  int side = 32;  // of the photographs, pixels
  int held_out_every = 4;
  int num_points = 200;
  std::optional<DepthPrior::Kind> depth = {};
};
SyntheticScene TinyScene(const TinyOptions& options = {});
inline Capture TinyCapture(const TinyOptions& options = {}) { return TinyScene(options).capture; }

// A run of stage one that is over before it has left out anything, with density control.
ReconstructOptions TinyReconstruct(int num_steps);
FeatureOptions TinyFeatures(int num_steps);

struct StageOneRun {
  Gaussians gaussians;
  std::vector<double> losses;  // by report
  StepReport last;
  std::vector<SkippedTerm> skipped;
  double psnr = 0;  // of the held-out views; 0: there are none
  // Adam's, of all planes.
  float largest_moment1 = 0, largest_moment2 = 0;
  int32_t most_steps = 0;  // of a Gaussian
};
// Checks what holds of every run: all losses and parameters are finite, log scales within their
// bounds, moments finite, second moments not negative, no gradient row skipped, no Gaussian culled.
absl::StatusOr<StageOneRun> RunStageOne(Backend& backend, const Capture& capture,
                                        const ReconstructOptions& options);

struct StageTwoRun {
  FeatureField field;
  std::vector<double> losses;  // by step
};
// Likewise: losses, features and the gate are finite, features of length 1 or 0.
absl::StatusOr<StageTwoRun> RunStageTwo(Backend& backend, const Capture& capture,
                                        const Gaussians& gaussians, const FeatureOptions& options);

// Means of the first and of the last `share` of the values.
double MeanOfFirst(const std::vector<double>& values, double share);
double MeanOfLast(const std::vector<double>& values, double share);

// Mean IoU of the synthetic objects by the one-click protocol: scale and threshold are chosen on
// the first held-out view and scored on the others.
absl::StatusOr<double> ClickIou(Backend& backend, const SyntheticScene& scene,
                                const Gaussians& gaussians, const FeatureField& field);

// Two threads, and the device.
std::unique_ptr<Backend> MakeCpu();
inline auto CpuAndCuda() {
  return ::testing::Values(BackendCase{"Cpu", MakeCpu}, BackendCase{"Cuda", MakeCuda});
}

}  // namespace pepeseg::testing
