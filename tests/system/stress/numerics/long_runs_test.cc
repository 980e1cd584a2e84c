#include <algorithm>
#include <cmath>
#include <cstdio>
#include <string>

#include "tests/system/stress/numerics/measured.h"
#include "tests/system/stress/numerics/tiny_runs.h"
#include "tests/testing/full_stress.h"
#include "tests/testing/status_testing.h"

// 100,000 steps of each stage on a tiny scene; 1,000 in the short run.

namespace pepeseg::testing {
namespace {

int NumLongSteps() { return FullStress() ? 100'000 : 1'000; }

class LongRuns : public BackendTest {};
INSTANTIATE_TEST_SUITE_P(Backends, LongRuns, CpuAndCuda(), BackendName);

float Largest(const Gaussians& gaussians, int plane, int num_planes) {
  float largest = 0;
  for (int k = plane; k < plane + num_planes; ++k) {
    for (const float value : gaussians.Plane(k)) largest = std::max(largest, std::abs(value));
  }
  return largest;
}

float LongestQuaternion(const Gaussians& gaussians) {
  float longest = 0;
  for (int64_t i = 0; i < gaussians.count; ++i) {
    float squares = 0;
    for (int k = 0; k < 4; ++k) {
      squares += gaussians.Plane(kRotationPlane + k)[i] * gaussians.Plane(kRotationPlane + k)[i];
    }
    longest = std::max(longest, std::sqrt(squares));
  }
  return longest;
}

// Checks the largest value of each kind of parameter, and the quality of the result.
void ExpectRun(const Backend& backend, const std::string& name, const StageOneRun& run) {
  const auto expect = [&](const char* what, double value) {
    ExpectAsMeasured(backend, "long run, " + name + ": " + what, value);
  };
  expect("loss of the first 2 %", MeanOfFirst(run.losses, 0.02));
  expect("loss of the last tenth", MeanOfLast(run.losses, 0.1));
  expect("held out", run.psnr);
  expect("largest mean", Largest(run.gaussians, kMeanPlane, 3));
  expect("longest quaternion", LongestQuaternion(run.gaussians));
  expect("largest opacity logit", Largest(run.gaussians, kOpacityPlane, 1));
  expect("largest SH coefficient",
         Largest(run.gaussians, kShPlane, NumPlanes(run.gaussians.sh_degree) - kShPlane));
}

// After the last densification the loss must not rise again.
void ExpectNoDrift(const std::vector<double>& losses) {
  const std::vector<double> grown(losses.begin(), losses.begin() + losses.size() * 7 / 10);
  EXPECT_LT(MeanOfLast(losses, 0.1), MeanOfFirst(losses, 0.02));
  EXPECT_LT(MeanOfLast(losses, 0.1),
            MeanOfLast(grown, 0.1) + 0.05 * std::abs(MeanOfLast(grown, 0.1)));
}

TEST_P(LongRuns, TrainStageOneWithABudget) {
  ReconstructOptions options = TinyReconstruct(NumLongSteps());
  options.min_band_gain = 0;  // keeps all SH bands to the end
  ASSERT_OK_AND_ASSIGN(
      const StageOneRun run,
      RunStageOne(*backend_, TinyCapture({.depth = DepthPrior::Kind::kDisparity}), options));
  ExpectRun(*backend_, "budgeted", run);
  ExpectNoDrift(run.losses);
  EXPECT_EQ(run.most_steps, NumLongSteps());
}

TEST_P(LongRuns, TrainStageOneWithResets) {
  ReconstructOptions options = TinyReconstruct(NumLongSteps());
  options.pixels_per_gaussian = 0;
  options.opacity_reset_every = std::max(100, NumLongSteps() / 30);
  ASSERT_OK_AND_ASSIGN(const StageOneRun run, RunStageOne(*backend_, TinyCapture(), options));
  ExpectRun(*backend_, "with resets", run);
  ExpectNoDrift(run.losses);
}

// Density control runs to the end and no Gaussian is pruned, so the opacity of Gaussians that no
// photograph supports falls without limit.
TEST_P(LongRuns, TrainStageOneWithoutPruning) {
  ReconstructOptions options = TinyReconstruct(NumLongSteps());
  options.prune_opacity = 0;
  options.densify_until = 1;
  options.densify_every = 10;
  options.opacity_decay = 0.5f;
  ASSERT_OK_AND_ASSIGN(const StageOneRun run, RunStageOne(*backend_, TinyCapture(), options));
  ExpectRun(*backend_, "never pruned", run);
}

// Without decay nothing keeps an opacity from reaching 1.
TEST_P(LongRuns, TrainStageOneWithoutDecay) {
  ReconstructOptions options = TinyReconstruct(NumLongSteps());
  options.opacity_decay = 1;
  options.opacity_learning_rate = 1;
  options.densify_until = 1;
  ASSERT_OK_AND_ASSIGN(const StageOneRun run, RunStageOne(*backend_, TinyCapture(), options));
  ExpectRun(*backend_, "no decay", run);
}

TEST_P(LongRuns, TrainStageTwo) {
  const Capture capture = TinyCapture({.depth = DepthPrior::Kind::kDisparity});
  ReconstructOptions geometry = TinyReconstruct(300);
  ASSERT_OK_AND_ASSIGN(const StageOneRun frozen, RunStageOne(*MakeCpu(), capture, geometry));
  ASSERT_OK_AND_ASSIGN(const StageTwoRun run, RunStageTwo(*backend_, capture, frozen.gaussians,
                                                          TinyFeatures(NumLongSteps())));
  EXPECT_EQ(static_cast<int>(run.losses.size()), NumLongSteps());
  const float gate = std::abs(
      *std::ranges::max_element(run.field.gate, {}, [](float value) { return std::abs(value); }));
  ExpectAsMeasured(*backend_, "long run, stage two: loss of the last tenth",
                   MeanOfLast(run.losses, 0.1));
  ExpectAsMeasured(*backend_, "long run, stage two: largest gate value", gate);
  ExpectNoDrift(run.losses);
}

}  // namespace
}  // namespace pepeseg::testing
