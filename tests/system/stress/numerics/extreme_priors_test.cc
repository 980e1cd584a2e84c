#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>
#include <random>
#include <string>

#include "tests/system/stress/numerics/measured.h"
#include "tests/system/stress/numerics/tiny_runs.h"
#include "tests/testing/full_stress.h"
#include "tests/testing/status_testing.h"

// Depth priors that are useless or wrong. They may cost little quality, and priors that do not
// agree with the scene are skipped and counted.

namespace pepeseg::testing {
namespace {

int NumPriorSteps() { return FullStress() ? 5'000 : 500; }
constexpr float kUnknown = std::numeric_limits<float>::quiet_NaN();

class ExtremePriors : public BackendTest {
 protected:
  template <class Fn>
  StageOneRun Learn(const char* what, Fn&& change) {
    Capture capture = TinyCapture({.depth = DepthPrior::Kind::kDisparity});
    for (View& view : capture.views) change(view.depth);
    const auto run = RunStageOne(*backend_, capture, TinyReconstruct(NumPriorSteps()));
    EXPECT_OK(run.status()) << what;
    if (!run.ok()) return {};
    std::printf("%s: %lld depths skipped\n", what,
                static_cast<long long>(run->last.num_skipped_depths));
    ExpectAsMeasured(*backend_, std::string("priors, ") + what, run->psnr);
    ExpectStageTwo(capture, run->gaussians);
    return *run;
  }

  // The perception loss also reads the priors.
  void ExpectStageTwo(const Capture& capture, const Gaussians& gaussians) {
    FeatureOptions options = TinyFeatures(NumPriorSteps() / 5);
    const auto run = RunStageTwo(*backend_, capture, gaussians, options);
    EXPECT_OK(run.status());
  }
};
INSTANTIATE_TEST_SUITE_P(Backends, ExtremePriors, CpuAndCuda(), BackendName);

constexpr double kMayCost = 1;  // allowed loss of PSNR, dB; measured: at most 0.6

TEST_P(ExtremePriors, CostLittleIfWrong) {
  const double with = Learn("exact", [](DepthPrior&) {}).psnr;
  const auto none = Learn("none", [](DepthPrior& prior) { prior.values.clear(); });
  EXPECT_GT(with, none.psnr - kMayCost);
  EXPECT_EQ(none.last.num_skipped_depths, 0);

  const auto constant =
      Learn("constant", [](DepthPrior& prior) { std::ranges::fill(prior.values, 0.5f); });
  EXPECT_GT(constant.psnr, none.psnr - kMayCost);
  EXPECT_GT(constant.last.num_skipped_depths, 0);

  const auto inverted = Learn("inverted", [](DepthPrior& prior) {
    for (float& value : prior.values) value = 1 - value;
  });
  EXPECT_GT(inverted.psnr, none.psnr - kMayCost);
  EXPECT_GT(inverted.last.num_skipped_depths, 0);

  const auto unknown =
      Learn("NaN", [](DepthPrior& prior) { std::ranges::fill(prior.values, kUnknown); });
  EXPECT_EQ(unknown.psnr, none.psnr);  // the same as without priors
}

TEST_P(ExtremePriors, GiveFiniteNumbersWithNoiseAndFewKnownPixels) {
  std::mt19937_64 random(1);
  std::uniform_real_distribution<float> uniform(0, 1);
  Learn("noise", [&](DepthPrior& prior) {
    for (float& value : prior.values) value = uniform(random);
  });
  Learn("one pixel known", [&](DepthPrior& prior) {
    std::ranges::fill(prior.values, kUnknown);
    prior.values[500] = 0.5f;
  });
  Learn("one in a hundred known", [&](DepthPrior& prior) {
    for (float& value : prior.values) value = uniform(random) < 0.01f ? value : kUnknown;
  });
  Learn("two values", [&](DepthPrior& prior) {
    for (float& value : prior.values) value = value > 0.5f ? 1 : 0;
  });
}

}  // namespace
}  // namespace pepeseg::testing
