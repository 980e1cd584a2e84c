#pragma once

#include <memory>
#include <optional>
#include <vector>

#include "absl/status/statusor.h"
#include "core/base/progress.h"
#include "core/features/options.h"
#include "core/reconstruct/options.h"
#include "core/scene/capture.h"
#include "core/scene/model.h"
#include "kernels/backend.h"
#include "tests/kernels/backend_test.h"
#include "tests/testing/synthetic_capture.h"

// The stages on scenes so small that many or very long runs take seconds, and checks that hold for
// every run with any input.

namespace pepeseg::testing {

struct TinyOptions {
  int num_views = 9;
  int side = 32;  // width and height of the photographs, pixels
  int held_out_every = 4;
  int num_points = 200;
  std::optional<DepthPrior::Kind> depth = {};
};
SyntheticScene TinyScene(const TinyOptions& options = {});
inline Capture TinyCapture(const TinyOptions& options = {}) { return TinyScene(options).capture; }

// Options of a short run of stage one with density control that skips no part.
ReconstructOptions TinyReconstruct(int num_steps);
FeatureOptions TinyFeatures(int num_steps);

struct StageOneRun {
  Gaussians gaussians;
  std::vector<double> losses;  // one for each report
  StepReport last;
  std::vector<SkippedPart> skipped;
  double psnr = 0;  // PSNR of the held-out views, dB; 0: there are none
  // Adam's moments of all planes.
  float largest_moment1 = 0, largest_moment2 = 0;
  int32_t most_steps = 0;  // largest step count of a Gaussian
};
// Runs stage one, and checks what holds for every run: losses, parameters and moments are finite,
// log scales are within their bounds, second moments are not negative, no gradient was skipped, no
// Gaussian was culled.
absl::StatusOr<StageOneRun> RunStageOne(Backend& backend, const Capture& capture,
                                        const ReconstructOptions& options);

struct StageTwoRun {
  FeatureField field;
  std::vector<double> losses;  // one for each step
};
// Runs stage two, and checks what holds for every run: losses, features and the gate are finite,
// and features have length 1 or 0.
absl::StatusOr<StageTwoRun> RunStageTwo(Backend& backend, const Capture& capture,
                                        const Gaussians& gaussians, const FeatureOptions& options);

// Returns the means of the first and of the last `share` of the values.
double MeanOfFirst(const std::vector<double>& values, double share);
double MeanOfLast(const std::vector<double>& values, double share);
// Returns the upper median of the last `share` of the values. A step of stage two that draws a
// pixel of a floater has a loss far from the others; how many do so in a short run is chance.
double MedianOfLast(const std::vector<double>& values, double share);

// Returns the mean IoU of the synthetic objects by the one-click protocol: scale and threshold are
// chosen on the first held-out view and scored on the others.
absl::StatusOr<double> ClickIou(Backend& backend, const SyntheticScene& scene,
                                const Gaussians& gaussians, const FeatureField& field);

// Returns a CPU backend with two threads.
std::unique_ptr<Backend> MakeCpu();
// Returns the parameters of a test on both backends.
inline auto CpuAndCuda() {
  return ::testing::Values(BackendCase{"Cpu", MakeCpu}, BackendCase{"Cuda", MakeCuda});
}

}  // namespace pepeseg::testing
