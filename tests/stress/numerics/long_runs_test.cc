#include <algorithm>
#include <cmath>
#include <cstdio>

#include "tests/stress/full_stress.h"
#include "tests/stress/numerics/tiny_runs.h"
#include "tests/testing/status_testing.h"

// 100,000 steps of each stage on a tiny scene; 1,000 in the short form.

namespace pepeseg::testing {
namespace {

int NumSteps() { return FullStress() ? 100'000 : 1'000; }

class LongRuns : public BackendTest {};
INSTANTIATE_TEST_SUITE_P(Backends, LongRuns, CpuAndCuda(), BackendName);

float Largest(const Gaussians& gaussians, int plane, int num_planes) {
  float largest = 0;
  for (int k = plane; k < plane + num_planes; ++k) {
    for (const float value : gaussians.Plane(k)) largest = std::max(largest, std::abs(value));
  }
  return largest;
}

void Print(const char* name, const StageOneRun& run) {
  std::printf(
      "%s: loss %.5f -> %.5f -> %.5f, held out %.2f dB, %lld Gaussians, largest |mean| %.2f "
      "|log scale| %.1f |quaternion| %.2f |logit| %.1f |SH| %.1f\n",
      name, MeanOfFirst(run.losses, 0.02),
      MeanOfLast({run.losses.begin(), run.losses.begin() + run.losses.size() * 7 / 10}, 0.1),
      MeanOfLast(run.losses, 0.1), run.psnr, static_cast<long long>(run.gaussians.count),
      Largest(run.gaussians, kMeanPlane, 3), Largest(run.gaussians, kLogScalePlane, 3),
      Largest(run.gaussians, kRotationPlane, 4), Largest(run.gaussians, kOpacityPlane, 1),
      Largest(run.gaussians, kShPlane, NumPlanes(run.gaussians.sh_degree) - kShPlane));
}

// What was learnt stays learnt: after the last growth the loss does not rise again.
void ExpectNoDrift(const std::vector<double>& losses) {
  const std::vector<double> grown(losses.begin(), losses.begin() + losses.size() * 7 / 10);
  EXPECT_LT(MeanOfLast(losses, 0.1), MeanOfFirst(losses, 0.02));
  EXPECT_LT(MeanOfLast(losses, 0.1), MeanOfLast(grown, 0.1) + 0.01);
}

TEST_P(LongRuns, StageOneBudgeted) {
  ReconstructOptions options = TinyReconstruct(NumSteps());
  options.min_band_gain = 0;  // all bands to the end
  ASSERT_OK_AND_ASSIGN(
      const StageOneRun run,
      RunStageOne(*backend_, TinyCapture({.depth = DepthPrior::Kind::kDisparity}), options));
  Print("budgeted", run);
  ExpectNoDrift(run.losses);
  EXPECT_EQ(run.most_steps, NumSteps());
  EXPECT_GT(run.psnr, 17);
}

TEST_P(LongRuns, StageOneWithResets) {
  ReconstructOptions options = TinyReconstruct(NumSteps());
  options.pixels_per_gaussian = 0;
  options.opacity_reset_every = std::max(100, NumSteps() / 30);
  ASSERT_OK_AND_ASSIGN(const StageOneRun run, RunStageOne(*backend_, TinyCapture(), options));
  Print("with resets", run);
  ExpectNoDrift(run.losses);
  EXPECT_GT(run.psnr, 17);
}

// Density control to the very end, and no Gaussian is pruned: opacities fade without end where the
// photographs do not hold them.
TEST_P(LongRuns, StageOneThatNeverPrunes) {
  ReconstructOptions options = TinyReconstruct(NumSteps());
  options.prune_opacity = 0;
  options.densify_until = 1;
  options.densify_every = 10;
  options.opacity_decay = 0.5f;
  ASSERT_OK_AND_ASSIGN(const StageOneRun run, RunStageOne(*backend_, TinyCapture(), options));
  Print("never pruned", run);
}

// Without decay nothing holds an opacity from becoming 1.
TEST_P(LongRuns, StageOneWithoutDecay) {
  ReconstructOptions options = TinyReconstruct(NumSteps());
  options.opacity_decay = 1;
  options.opacity_learning_rate = 1;
  options.densify_until = 1;
  ASSERT_OK_AND_ASSIGN(const StageOneRun run, RunStageOne(*backend_, TinyCapture(), options));
  Print("no decay", run);
}

TEST_P(LongRuns, StageTwo) {
  const Capture capture = TinyCapture({.depth = DepthPrior::Kind::kDisparity});
  ReconstructOptions geometry = TinyReconstruct(300);
  ASSERT_OK_AND_ASSIGN(const StageOneRun frozen, RunStageOne(*MakeCpu(), capture, geometry));
  ASSERT_OK_AND_ASSIGN(const StageTwoRun run,
                       RunStageTwo(*backend_, capture, frozen.gaussians, TinyFeatures(NumSteps())));
  EXPECT_EQ(static_cast<int>(run.losses.size()), NumSteps());
  const float gate = std::abs(
      *std::ranges::max_element(run.field.gate, {}, [](float value) { return std::abs(value); }));
  std::printf("features: loss %.4f -> %.4f, largest |gate| %.2f\n", MeanOfFirst(run.losses, 0.02),
              MeanOfLast(run.losses, 0.1), gate);
  ExpectNoDrift(run.losses);
}

}  // namespace
}  // namespace pepeseg::testing
