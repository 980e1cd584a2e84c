#include "kernels/math/dropout.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "tests/kernels/backend_test.h"
#include "tests/kernels/rendered.h"

// Dropout against a render without it, of a scene from which the same Gaussians were taken and in
// which the opacities of the others were raised by hand.

namespace pepeseg {
namespace {

constexpr float kShare = 0.3f;
constexpr uint32_t kSeed = 11;

class DropoutTest : public BackendTest {};
INSTANTIATE_TEST_SUITE_P(Backends, DropoutTest, AllBackends(), BackendName);

double SigmoidOf(double logit) { return 1 / (1 + std::exp(-logit)); }

// A scene whose opacities stay below 1 when they are divided by 1 - kShare.
HostGaussians FaintScene() { return RandomScene({.count = 200, .max_opacity_logit = 0.5f}); }

// Removes by a very low opacity, so that the others keep their numbers.
HostGaussians WithoutSome(HostGaussians scene) {
  for (int64_t i = 0; i < scene.count; ++i) {
    float& logit = scene.At(kOpacityPlane, i);
    const double opacity = SigmoidOf(logit) / (1 - double{kShare});
    const bool is_left_out = IsLeftOut(kShare, kSeed, static_cast<uint32_t>(i));
    logit = is_left_out ? -30.0f : static_cast<float>(std::log(opacity / (1 - opacity)));
  }
  return scene;
}

TEST_P(DropoutTest, RendersTheGaussiansThatAreLeft) {
  Rendered dropped(*backend_, FaintScene(), TestView(60, 45));
  dropped.dropout = {kShare, kSeed};
  dropped.Render();
  Rendered want(*backend_, WithoutSome(FaintScene()), TestView(60, 45));
  want.Render();
  EXPECT_EQ(dropped.Counter(kNumVisible), want.Counter(kNumVisible));
  const std::vector<float> got = Download(dropped.color), expected = Download(want.color);
  for (size_t i = 0; i < got.size(); ++i) ASSERT_NEAR(got[i], expected[i], 1e-5) << i;
}

TEST_P(DropoutTest, ItsGradientIsThatOfTheGaussiansThatAreLeft) {
  const HostGaussians scene = FaintScene(), raised = WithoutSome(scene);
  const std::vector<float> color_grad = RandomValues(3 * 60 * 45, 9);
  Rendered dropped(*backend_, scene, TestView(60, 45));
  dropped.dropout = {kShare, kSeed};
  dropped.Render();
  dropped.Backward(color_grad);
  Rendered want(*backend_, raised, TestView(60, 45));
  want.Render();
  want.Backward(color_grad);
  const std::vector<float> got = dropped.ParameterGradient();
  std::vector<float> expected = want.ParameterGradient();
  // The chain rule from the raised opacity to the logit before it was raised.
  for (int64_t i = 0; i < scene.count; ++i) {
    const double opacity = SigmoidOf(scene.At(kOpacityPlane, i));
    const double high = SigmoidOf(raised.At(kOpacityPlane, i));
    const double factor = opacity * (1 - opacity) / (1 - double{kShare}) / (high * (1 - high));
    float& grad = expected[kOpacityPlane * scene.count + i];
    grad = grad == 0 ? 0.0f : static_cast<float>(factor * static_cast<double>(grad));
  }
  double largest = 0;
  for (const float grad : expected) largest = std::max(largest, std::abs(double{grad}));
  for (size_t i = 0; i < got.size(); ++i) ASSERT_NEAR(got[i], expected[i], 2e-5 * largest) << i;
}

TEST_P(DropoutTest, AnotherSeedLeavesOutOthers) {
  Rendered scene(*backend_, FaintScene(), TestView(60, 45));
  scene.dropout = {kShare, kSeed};
  scene.Render();
  const std::vector<float> first = Download(scene.color);
  scene.Render();
  EXPECT_EQ(Download(scene.color), first);
  scene.dropout.seed = kSeed + 1;
  scene.Render();
  EXPECT_NE(Download(scene.color), first);
}

TEST(IsLeftOut, TakesItsShareOfTheGaussiansWithEachSeed) {
  for (const uint32_t seed : {0u, 1u, 12345u}) {
    int count = 0;
    for (uint32_t i = 0; i < 100'000; ++i) count += IsLeftOut(0.1f, seed, i) ? 1 : 0;
    EXPECT_NEAR(count, 10'000, 400) << seed;  // 4 standard deviations
    EXPECT_FALSE(IsLeftOut(0, seed, 0));
  }
}

}  // namespace
}  // namespace pepeseg
