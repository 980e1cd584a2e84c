#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "tests/kernels/backend_test.h"
#include "tests/kernels/central_differences.h"
#include "tests/kernels/reference_gradient.h"
#include "tests/kernels/rendered.h"

// The backward pass in two steps: the chain of Vjp functions in double against central differences
// of the reference renderer, then the backends against that chain.

namespace pepeseg {
namespace {

class RenderBackwardTest : public BackendTest {};
INSTANTIATE_TEST_SUITE_P(Backends, RenderBackwardTest, AllBackends(), BackendName);

ReferenceScene InDouble(const HostGaussians& host) {
  return {host.count, host.sh_degree, {host.planes.begin(), host.planes.end()}};
}

std::vector<double> InDouble(const std::vector<float>& values) {
  return {values.begin(), values.end()};
}

// The options of the reference for this scene.
ReferenceOptions OptionsOf(const Rendered& scene) {
  ReferenceOptions options;
  options.near_plane = scene.near_plane;
  options.inverse_depth = scene.inverse_depth;
  return options;
}

// Returns random gradients of an image that are 0 at pixels with a close call, so that the loss is
// smooth.
ImageGrad SmoothGrad(const ReferenceImage& image, uint64_t seed) {
  const auto num_pixels = static_cast<int64_t>(image.alpha.size());
  ImageGrad grad = {InDouble(RandomValues(3 * num_pixels, seed)),
                    InDouble(RandomValues(num_pixels, seed + 1)),
                    InDouble(RandomValues(num_pixels, seed + 2))};
  for (int64_t i = 0; i < num_pixels; ++i) {
    if (!image.close_call[i]) continue;
    for (int c = 0; c < 3; ++c) grad.color[c * num_pixels + i] = 0;
    grad.alpha[i] = grad.depth[i] = 0;
  }
  return grad;
}

// Returns the values of one plane.
std::vector<double> PlaneOf(const std::vector<double>& planes, int64_t count, int plane) {
  return {planes.begin() + plane * count, planes.begin() + (plane + 1) * count};
}

// Compares the gradient by Vjp functions with central differences, plane by plane.
void ExpectMatchesCentralDifferences(bool inverse_depth) {
  const ReferenceScene scene = InDouble(RandomScene({.count = 6, .max_scale = 0.5f, .seed = 7}));
  const PinholeView view = TestView(20, 14);
  ReferenceOptions options{.near_plane = 0.05, .inverse_depth = inverse_depth, .close = 0.03};
  const ImageGrad grad = SmoothGrad(RenderReference(scene, view, options), 1);
  // Enough pixels have no close call.
  ASSERT_GT(std::count_if(grad.alpha.begin(), grad.alpha.end(), [](double g) { return g != 0; }),
            60);
  const auto loss = [&](const std::vector<double>& planes) {
    return LossOf(RenderReference({scene.count, scene.sh_degree, planes}, view, options), grad);
  };
  const auto want = CentralDifferences(loss, scene.planes, 1e-4);
  const auto got = ReferenceGradient(scene, view, options, grad);
  for (int plane = 0; plane < NumPlanes(scene.sh_degree); ++plane) {
    EXPECT_LT(RelativeError(PlaneOf(got, scene.count, plane), PlaneOf(want, scene.count, plane)),
              1e-6)
        << "plane " << plane;
  }
}

TEST(RenderChainVjp, MatchesCentralDifferencesOfTheReferenceRenderer) {
  ExpectMatchesCentralDifferences(false);
}

TEST(RenderChainVjp, MatchesCentralDifferencesWithInverseDepth) {
  ExpectMatchesCentralDifferences(true);
}

// Compares the backend's gradients of all parameters, plane by plane, with those in double.
void ExpectMatchesReferenceGradient(Rendered& scene) {
  scene.Render();
  const ReferenceScene reference = InDouble(scene.host);
  const ReferenceOptions options = OptionsOf(scene);
  const ImageGrad grad = SmoothGrad(RenderReference(reference, scene.view, options), 5);
  const auto in_float = [](const std::vector<double>& v) {
    return std::vector<float>(v.begin(), v.end());
  };
  scene.Backward(in_float(grad.color), in_float(grad.alpha), in_float(grad.depth));
  const auto got = InDouble(scene.ParameterGradient());
  const auto want = ReferenceGradient(reference, scene.view, options, grad);
  for (int plane = 0; plane < NumPlanes(scene.host.sh_degree); ++plane) {
    EXPECT_LT(RelativeError(PlaneOf(got, scene.host.count, plane),
                            PlaneOf(want, scene.host.count, plane)),
              3e-4)
        << "plane " << plane;
  }
}

TEST_P(RenderBackwardTest, MatchesReferenceGradient) {
  for (const uint64_t seed : {1, 2, 3}) {
    Rendered scene(*backend_, RandomScene({.count = 150, .seed = seed}), TestView(97, 61));
    ExpectMatchesReferenceGradient(scene);
  }
}

TEST_P(RenderBackwardTest, MatchesReferenceGradientAtEverySphericalHarmonicsDegree) {
  for (const int degree : {0, 1, 2, 3}) {
    Rendered scene(*backend_, RandomScene({.count = 60, .sh_degree = degree}), TestView(48, 32));
    ExpectMatchesReferenceGradient(scene);
  }
}

TEST_P(RenderBackwardTest, MatchesReferenceGradientBehindOpaqueWalls) {
  Rendered scene(*backend_,
                 RandomScene({.count = 400,
                              .min_scale = 0.1f,
                              .max_scale = 0.4f,
                              .min_opacity_logit = 2,
                              .max_opacity_logit = 8}),
                 TestView(64, 48));
  ExpectMatchesReferenceGradient(scene);
}

TEST_P(RenderBackwardTest, MatchesReferenceGradientOfInverseDepth) {
  for (const uint64_t seed : {1, 2}) {
    Rendered scene(*backend_, RandomScene({.count = 150, .seed = seed}), TestView(97, 61));
    scene.inverse_depth = true;
    ExpectMatchesReferenceGradient(scene);
  }
}

// A pixel alone gives opacity * d loss / d opacity = d loss / d ln g, as alpha = opacity * g.
TEST_P(RenderBackwardTest, SumsTheSquaresOfThePixels) {
  constexpr int64_t kNumPixels = 12 * 9;
  Rendered scene(*backend_, RandomScene({.count = 20, .max_scale = 0.5f}), TestView(12, 9));
  scene.Render();
  const auto color = RandomValues(3 * kNumPixels, 1), alpha = RandomValues(kNumPixels, 2),
             depth = RandomValues(kNumPixels, 3);
  const std::vector<Splat> splats = Download(scene.scratch.visible_splat);
  std::vector<double> want(splats.size());
  for (int64_t pixel = 0; pixel < kNumPixels; ++pixel) {
    std::vector<float> one(3 * kNumPixels);
    for (int c = 0; c < 3; ++c) one[c * kNumPixels + pixel] = color[c * kNumPixels + pixel];
    scene.Backward(one);
    const std::vector<SplatGrad> grads = Download(scene.scratch.visible_grad);
    for (size_t i = 0; i < splats.size(); ++i) {
      want[i] += std::pow(static_cast<double>(splats[i].opacity) * grads[i].opacity, 2);
    }
  }
  const auto squares = [&] {
    std::vector<double> values;
    for (const SplatGrad& grad : Download(scene.scratch.visible_grad)) {
      values.push_back(grad.squares);
    }
    return values;
  };
  scene.Backward(color);
  EXPECT_LT(RelativeError(squares(), want), 1e-5);
  // Gradients of depth and alpha do not count.
  scene.Backward(color, alpha);
  EXPECT_LT(RelativeError(squares(), want), 1e-5);
  scene.Backward(color, alpha, depth);
  EXPECT_LT(RelativeError(squares(), want), 1e-5);
}

// Pixels with gradients of zero only are skipped; one with any other must not be.
TEST_P(RenderBackwardTest, IsTheSumOfTheGradientsOfEachImage) {
  constexpr int64_t kNumPixels = 40 * 30;
  Rendered scene(*backend_, RandomScene({.count = 80}), TestView(40, 30));
  scene.Render();
  const auto color = RandomValues(3 * kNumPixels, 1), alpha = RandomValues(kNumPixels, 2),
             depth = RandomValues(kNumPixels, 3);
  const std::vector<float> none(kNumPixels), black(3 * kNumPixels);
  scene.Backward(color, alpha, depth);
  const auto want = InDouble(scene.ParameterGradient());
  std::vector<double> sum(want.size(), 0.0);
  const auto add = [&] {
    const auto part = scene.ParameterGradient();
    EXPECT_TRUE(std::ranges::any_of(part, [](float g) { return g != 0; }));
    for (size_t i = 0; i < sum.size(); ++i) sum[i] += double{part[i]};
  };
  for (int c = 0; c < 3; ++c) {
    std::vector<float> one = black;
    std::copy_n(color.begin() + c * kNumPixels, kNumPixels, one.begin() + c * kNumPixels);
    scene.Backward(one, none, none);
    add();
  }
  scene.Backward(black, alpha, none);
  add();
  scene.Backward(black, none, depth);
  add();
  EXPECT_LT(RelativeError(sum, want), 1e-5);
}

TEST_P(RenderBackwardTest, TakesEmptyAlphaAndDepthGradientsAsZeros) {
  Rendered scene(*backend_, RandomScene({.count = 50}), TestView(40, 30));
  scene.Render();
  const auto color_grad = RandomValues(3 * 40 * 30, 1);
  scene.Backward(color_grad);
  const auto without = scene.ParameterGradient();
  const std::vector<float> zeros(40 * 30);
  scene.Backward(color_grad, zeros, zeros);
  const auto with = scene.ParameterGradient();
  for (size_t i = 0; i < with.size(); ++i) ASSERT_NEAR(with[i], without[i], 1e-6f) << i;
}

}  // namespace
}  // namespace pepeseg
