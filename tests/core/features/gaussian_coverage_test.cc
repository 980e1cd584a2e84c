#include "core/features/gaussian_coverage.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <numbers>

#include "tests/testing/point_gaussians.h"

namespace pepeseg {
namespace {

using ::testing::ElementsAre;
using ::testing::FloatEq;

constexpr int kSize = 40;
constexpr float kUnseen = 0.005f;

// Returns a view from the origin along z, rotated by `angle` about y, all of it under a mask.
View Looking(double angle) {
  View view;
  view.camera = {kSize, kSize, 40, 40, kSize / 2.0, kSize / 2.0};
  view.cam_from_world.rotation = Eigen::AngleAxisd(angle, Eigen::Vector3d::UnitY());
  view.masks = BuildMaskSet(kSize, kSize, {{BinaryMask{std::vector<uint8_t>(kSize * kSize, 1)}}});
  return view;
}

// Ten views look ahead and two back. There is a Gaussian ahead, one behind, and one above that no
// view shows.
struct Scene {
  Scene() {
    for (int i = 0; i < 10; ++i) capture.views.push_back(Looking(0.01 * i));
    for (int i = 0; i < 2; ++i) capture.views.push_back(Looking(std::numbers::pi + 0.01 * i));
    for (const Eigen::Vector3f& position :
         {Eigen::Vector3f(0, 0, 5), Eigen::Vector3f(0, 0, -5), Eigen::Vector3f(0, 50, 0)}) {
      capture.points.push_back({position, {255, 255, 255}});
    }
  }
  std::vector<float> Confidence(int min_confident_views) {
    const Gaussians gaussians = testing::PointGaussians(capture, 0.2f);
    Renderer frozen(*backend, gaussians, 1);
    return FeatureConfidence(capture, frozen, min_confident_views);
  }

  std::unique_ptr<Backend> backend = MakeCpuBackend(2);
  Capture capture;
};

TEST(FeatureConfidence, GrowsWithTheViewsThatShowAGaussian) {
  Scene scene;
  EXPECT_THAT(scene.Confidence(8), ElementsAre(1, FloatEq(0.0625f), kUnseen));
  EXPECT_THAT(scene.Confidence(2), ElementsAre(1, 1, kUnseen));
}

TEST(FeatureConfidence, IsAShareOfTheViewsWhereThereAreFew) {
  Scene scene;
  EXPECT_THAT(scene.Confidence(64),
              ElementsAre(FloatEq(100.0f / 144), FloatEq(4.0f / 144), kUnseen));
}

TEST(FeatureConfidence, IgnoresHeldOutViewsAndViewsWithoutMasks) {
  Scene scene;
  scene.capture.views[10].held_out = true;
  scene.capture.views[0].masks = {};
  EXPECT_THAT(scene.Confidence(64), ElementsAre(FloatEq(0.81f), FloatEq(0.01f), kUnseen));
}

TEST(FeatureConfidence, IsAShareOfASixthOfTheViewsWhereThereAreMany) {
  Scene scene;
  for (int i = 0; i < 36; ++i) scene.capture.views.push_back(Looking(0));
  EXPECT_THAT(scene.Confidence(1), ElementsAre(1, FloatEq(4.0f / 64), kUnseen));
}

TEST(FeatureConfidence, CountsAtMostSixtyFourViews) {
  Scene scene;
  for (int i = 0; i < 244; ++i) scene.capture.views.insert(scene.capture.views.begin(), Looking(0));
  // Every fourth of the 256 views is counted: neither of the last two, which look back.
  EXPECT_THAT(scene.Confidence(64), ElementsAre(1, kUnseen, kUnseen));
}

}  // namespace
}  // namespace pepeseg
