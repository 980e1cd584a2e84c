#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "tests/kernels/backend_test.h"
#include "tests/kernels/rendered.h"

// Renders at the limits: no Gaussians, tiny images, degenerate and extreme Gaussians, crowded
// tiles.

namespace pepeseg {
namespace {

constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
constexpr float kInfinity = std::numeric_limits<float>::infinity();

class RenderEdgeTest : public BackendTest {
 protected:
  // Renders forward and backward. Whatever the scene holds, images and gradients must be finite.
  void ExpectFinite(Rendered& scene) {
    scene.Render();
    const int64_t num_pixels = scene.alpha.size();
    scene.Backward(RandomValues(3 * num_pixels, 1), RandomValues(num_pixels, 2),
                   RandomValues(num_pixels, 3));
    for (const float x : Download(scene.color)) ASSERT_TRUE(std::isfinite(x));
    for (const float x : Download(scene.alpha)) ASSERT_TRUE(x >= 0 && x <= 1);
    for (const float x : Download(scene.depth)) ASSERT_TRUE(std::isfinite(x));
    for (const float x : scene.ParameterGradient()) ASSERT_TRUE(std::isfinite(x));
    EXPECT_EQ(scene.Counter(kNumSkippedGradientRows), 0);
  }
};
INSTANTIATE_TEST_SUITE_P(Backends, RenderEdgeTest, AllBackends(), BackendName);

// Small balls on the axis of AxisView's camera, one behind the other from z = 2 on, of opacity 0.5.
HostGaussians Balls(int64_t count) {
  HostGaussians out{count, 0, std::vector<float>(count * NumPlanes(0))};
  for (int64_t i = 0; i < count; ++i) {
    out.At(kMeanPlane + 2, i) = 2 + 0.01f * static_cast<float>(i);
    for (int k = 0; k < 3; ++k) out.At(kLogScalePlane + k, i) = std::log(0.05f);
    out.At(kRotationPlane, i) = 1;
    out.At(kShPlane + i % 3, i) = 1;
  }
  return out;
}

// A camera at the origin that looks along z.
PinholeView AxisView(int width, int height) {
  PinholeView view;
  view.width = width;
  view.height = height;
  view.fx = view.fy = 50;
  view.cx = 0.5f * static_cast<float>(width);
  view.cy = 0.5f * static_cast<float>(height);
  view.cam_from_world[0] = view.cam_from_world[5] = view.cam_from_world[10] = 1;
  return view;
}

TEST_P(RenderEdgeTest, ShowsTheSameWithoutBackwardAndThenRefusesIt) {
  const auto backend = GetParam().make();  // of its own, because an error is left in it
  Rendered scene(*backend, Balls(60), AxisView(40, 30));
  scene.Render();
  const std::vector<float> color = Download(scene.color), depth = Download(scene.depth);
  scene.for_backward = false;
  scene.Render();
  EXPECT_EQ(Download(scene.color), color);
  EXPECT_EQ(Download(scene.depth), depth);
  EXPECT_EQ(backend->error(), "");
  scene.Backward(RandomValues(3 * 40 * 30, 1));
  EXPECT_NE(backend->error(), "");
}

TEST_P(RenderEdgeTest, IsBlackWithoutGaussians) {
  Rendered scene(*backend_, HostGaussians{0, 3, {}}, TestView(33, 17));
  ExpectFinite(scene);
  const std::vector<float> color = Download(scene.color);
  for (int64_t i = 0; i < 33 * 17; ++i) {
    for (int c = 0; c < 3; ++c) EXPECT_EQ(color[c * 33 * 17 + i], 0);
  }
  EXPECT_EQ(scene.Counter(kNumVisible), 0);
  backend_->Update(scene.MakeUpdateArgs());
}

TEST_P(RenderEdgeTest, AcceptsAnImageOfOnePixel) {
  Rendered scene(*backend_, RandomScene({.count = 50}), TestView(1, 1));
  ExpectFinite(scene);
  EXPECT_GT(Download(scene.alpha)[0], 0.5f);
}

TEST_P(RenderEdgeTest, AcceptsAnyImageSize) {
  for (const auto& [width, height] : {std::pair{15, 17}, {16, 16}, {17, 31}, {1, 40}, {65, 2}}) {
    Rendered scene(*backend_, RandomScene({.count = 80}), TestView(width, height));
    ExpectFinite(scene);
  }
}

// A parameter of a ball and its new value.
struct Broken {
  int plane;
  float value;
  bool degenerate;  // false: only out of sight
};

TEST_P(RenderEdgeTest, CullsAndCountsDegenerateGaussians) {
  // Each case changes one parameter of the ball in the middle.
  const Broken cases[] = {{kMeanPlane, kNan, true},         {kMeanPlane + 1, kInfinity, true},
                          {kMeanPlane + 2, kNan, true},     {kMeanPlane + 2, -3, false},
                          {kMeanPlane + 2, 0.01f, false},   {kLogScalePlane, kNan, true},
                          {kLogScalePlane + 1, 85, true},   {kRotationPlane, 0, true},
                          {kRotationPlane + 2, kNan, true}, {kOpacityPlane, kNan, true},
                          {kOpacityPlane, -20, false},      {kShPlane, kNan, true},
                          {kMeanPlane, 1000, false}};
  for (const Broken& broken : cases) {
    HostGaussians balls = Balls(3);
    balls.At(broken.plane, 1) = broken.value;
    Rendered scene(*backend_, balls, AxisView(40, 40));
    ExpectFinite(scene);
    EXPECT_EQ(scene.Counter(kNumCulledDegenerate), broken.degenerate)
        << broken.plane << " " << broken.value;
    EXPECT_EQ(Download(scene.scratch.visible_gaussian), (std::vector<int32_t>{0, 2}));
  }
}

TEST_P(RenderEdgeTest, StaysFiniteForExtremeSizes) {
  HostGaussians balls = Balls(6);
  const float log_scales[6][3] = {{8, 8, 8},   {-30, -30, -30}, {3, -20, -20},
                                  {0, 0, -40}, {12, -12, 0},    {-3, -3, -3}};
  for (int64_t i = 0; i < 6; ++i) {
    for (int k = 0; k < 3; ++k) balls.At(kLogScalePlane + k, i) = log_scales[i][k];
    balls.At(kRotationPlane + 1, i) = 0.3f * static_cast<float>(i);
  }
  Rendered scene(*backend_, balls, AxisView(70, 50));
  ExpectFinite(scene);
  backend_->Update(scene.MakeUpdateArgs());
  for (const float x : Download(scene.gaussians)) ASSERT_TRUE(std::isfinite(x));
}

TEST_P(RenderEdgeTest, ShowsATinyGaussianOnItsPixel) {
  HostGaussians ball = Balls(1);
  for (int k = 0; k < 3; ++k) ball.At(kLogScalePlane + k, 0) = -30;
  Rendered scene(*backend_, ball, AxisView(21, 21));
  scene.Render();
  EXPECT_NEAR(Download(scene.alpha)[10 * 21 + 10], 0.5f, 1e-4f);
}

TEST_P(RenderEdgeTest, BlendsSeventyThousandGaussiansInOneTile) {
  constexpr int64_t kCount = 70000;  // above 2^16
  HostGaussians balls = Balls(kCount);
  for (int64_t i = 0; i < kCount; ++i) {
    balls.At(kMeanPlane + 2, i) = 2 + 3e-5f * static_cast<float>(kCount - i);
    balls.At(kOpacityPlane, i) = -5.2f;  // an opacity barely above 1/255, so that no pixel stops
  }
  Rendered scene(*backend_, balls, AxisView(16, 16));
  ExpectFinite(scene);
  EXPECT_EQ(scene.Counter(kNumTileEntries), kCount);
  EXPECT_GT(Download(scene.alpha)[8 * 16 + 8], 0.9998f);
}

TEST_P(RenderEdgeTest, OrdersByDepthAndEqualDepthsByIndex) {
  HostGaussians balls = Balls(3);
  for (int64_t i = 0; i < 3; ++i) balls.At(kMeanPlane + 2, i) = 2;
  balls.At(kMeanPlane + 2, 2) = 1.5f;
  Rendered scene(*backend_, balls, AxisView(16, 16));
  scene.Render();
  EXPECT_EQ(Download(scene.scratch.entry_visible), (std::vector<int32_t>{2, 0, 1}));
}

TEST_P(RenderEdgeTest, CullsAtTheNearPlane) {
  Rendered scene(*backend_, Balls(3), AxisView(16, 16));
  scene.near_plane = 2.005f;
  scene.Render();
  EXPECT_EQ(Download(scene.scratch.visible_gaussian), (std::vector<int32_t>{1, 2}));
  EXPECT_EQ(scene.Counter(kNumCulledDegenerate), 0);
}

}  // namespace
}  // namespace pepeseg
