#include "core/features/gaussian_coverage.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "core/features/batch_drawer.h"
#include "tests/testing/point_gaussians.h"

namespace pepeseg {
namespace {

using ::testing::Contains;
using ::testing::ElementsAre;
using ::testing::FloatEq;
using ::testing::IsEmpty;
using ::testing::IsSupersetOf;
using ::testing::Not;

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
    const auto measure = [&](bool find_uncovered) {
      return MeasureCoverage(*backend, capture, OwnMasks(capture), gaussians,
                             {min_confident_views, find_uncovered})
          .confidence;
    };
    const std::vector<float> confidence = measure(false);
    EXPECT_EQ(measure(true), confidence) << "it does not depend on what else is looked for";
    return confidence;
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

TEST(FeatureConfidence, IgnoresGaussiansInIgnoredPixels) {
  Scene scene;
  scene.capture.views[10].ignore.assign(kSize * kSize, 1);
  EXPECT_THAT(scene.Confidence(2), ElementsAre(1, FloatEq(0.25f), kUnseen));
}

TEST(FeatureConfidence, IsAShareOfASixthOfTheViewsWhereThereAreMany) {
  Scene scene;
  for (int i = 0; i < 36; ++i) scene.capture.views.push_back(Looking(0));
  EXPECT_THAT(scene.Confidence(1), ElementsAre(1, FloatEq(4.0f / 64), kUnseen));
}

TEST(FeatureConfidence, CountsAtMostSixtyFourViews) {
  Scene scene;
  // Every fourth of the 256 views is counted. All others look back, but for the last few.
  for (int i = 243; i >= 0; --i) {
    const double angle = i % 4 == 0 ? 0 : std::numbers::pi;
    scene.capture.views.insert(scene.capture.views.begin(), Looking(angle));
  }
  EXPECT_THAT(scene.Confidence(64), ElementsAre(1, kUnseen, kUnseen));
}

// The Gaussian covers a few pixels of either view: enough of one of 1,600 pixels, and not of one of
// a million.
TEST(FeatureConfidence, WantsTheSameShareOfThePixelsOfALargeView) {
  for (const double scale : {1.0, 25.0}) {
    Capture capture;
    View& view = capture.views.emplace_back(Looking(0));
    const int size = static_cast<int>(kSize * scale);
    view.camera = {size, size, 40 * scale, 40 * scale, size / 2.0, size / 2.0};
    view.masks = BuildMaskSet(size, size, {{BinaryMask{std::vector<uint8_t>(size * size, 1)}}});
    capture.points.push_back({Eigen::Vector3f(0, 0, 5), {255, 255, 255}});
    Gaussians gaussians = testing::PointGaussians(capture, 1e-4f);
    gaussians.Plane(kOpacityPlane)[0] = -4;  // an alpha of 0.018
    const auto backend = MakeCpuBackend(2);
    const GaussianCoverage coverage = MeasureCoverage(*backend, capture, OwnMasks(capture),
                                                      gaussians, {.min_confident_views = 1});
    EXPECT_THAT(coverage.confidence, ElementsAre(scale == 1 ? 1 : kUnseen));
  }
}

// Four equal views of a Gaussian to the left and one to the right. The mask of the first three
// views covers their left half, that of the last one their first scanlines alone.
struct HalfCovered {
  explicit HalfCovered(int scale) : size(kSize * scale) {
    for (int v = 0; v < 4; ++v) {
      View& view = capture.views.emplace_back();
      view.camera = {size, size, 40.0 * scale, 40.0 * scale, size / 2.0, size / 2.0};
      BinaryMask mask;
      for (int y = 0; y < size; ++y) {
        for (int x = 0; x < size; ++x) {
          mask.pixels.push_back(v < 3 ? x < size / 2 : y < size / 20);
        }
      }
      view.masks = BuildMaskSet(size, size, {{mask}});
    }
    for (const float x : {-1.0f, 1.0f}) {
      capture.points.push_back({Eigen::Vector3f(x, 0, 5), {255, 255, 255}});
    }
  }
  std::vector<UncoveredPixels> Uncovered() {
    const auto backend = MakeCpuBackend(2);
    return MeasureCoverage(*backend, capture, OwnMasks(capture),
                           testing::PointGaussians(capture, 0.2f), {.find_uncovered = true})
        .uncovered;
  }
  // Returns the grid pixels at most `radius` from the left or the right Gaussian, in 40ths of the
  // view's width.
  std::vector<int32_t> Near(bool left, double radius) const {
    const double scale = static_cast<double>(size) / kSize;
    std::vector<int32_t> pixels = GridPixels(capture.views[0].camera, 16'384);
    std::erase_if(pixels, [&](int32_t p) {
      return std::hypot((p % size + 0.5) / scale - (left ? 12 : 28),
                        static_cast<double>(p / size + 0.5) / scale - 20) > radius;
    });
    return pixels;
  }

  int size;
  Capture capture;
};

// A Gaussian has a standard deviation of 1.6 40ths of the view, and an alpha of a half at 1.9.
TEST(FindUncovered, SeparatesBackgroundFromMasksThatAViewLacks) {
  for (const int scale : {1, 25}) {
    SCOPED_TRACE(scale);
    HalfCovered scene(scale);
    const std::vector<UncoveredPixels> uncovered = scene.Uncovered();
    ASSERT_EQ(uncovered.size(), 4u);
    for (int v = 0; v < 4; ++v) {
      SCOPED_TRACE(v);
      EXPECT_THAT(uncovered[v].background, IsSupersetOf(scene.Near(false, 1.5)));
      EXPECT_THAT(scene.Near(false, 2.5), IsSupersetOf(uncovered[v].background));
      if (v == 3) continue;
      EXPECT_THAT(uncovered[v].covered_elsewhere, IsEmpty());
    }
    EXPECT_THAT(uncovered[3].covered_elsewhere, IsSupersetOf(scene.Near(true, 1.5)));
    EXPECT_THAT(scene.Near(true, 2.5), IsSupersetOf(uncovered[3].covered_elsewhere));
  }
}

TEST(FindUncovered, LeavesOutIgnoredPixelsAndHeldOutViews) {
  HalfCovered scene(1);
  constexpr int32_t kRight = 20 * kSize + 28;
  scene.capture.views[2].held_out = true;
  scene.capture.views[3].ignore.assign(kSize * kSize, 0);
  scene.capture.views[3].ignore[kRight] = 1;
  const std::vector<UncoveredPixels> uncovered = scene.Uncovered();
  EXPECT_THAT(uncovered[1].background, Contains(kRight));
  EXPECT_THAT(uncovered[2].background, IsEmpty());
  EXPECT_THAT(uncovered[3].background, Not(Contains(kRight)));
  EXPECT_THAT(uncovered[3].background, Contains(kRight + 1));
}

// Where all masks of the left Gaussian are on ignored pixels, it counts as background.
TEST(FindUncovered, CountsNoMaskOfIgnoredPixels) {
  HalfCovered scene(1);
  for (int v = 0; v < 3; ++v) {
    std::vector<uint8_t>& ignore = scene.capture.views[v].ignore;
    for (int p = 0; p < kSize * kSize; ++p) ignore.push_back(p % kSize < kSize / 2 ? 1 : 0);
  }
  const std::vector<UncoveredPixels> uncovered = scene.Uncovered();
  EXPECT_THAT(uncovered[3].covered_elsewhere, IsEmpty());
  EXPECT_THAT(uncovered[3].background, IsSupersetOf(scene.Near(true, 1.5)));
}

TEST(MeasureCoverage, LeavesEmptyWhatIsNotWanted) {
  HalfCovered scene(1);
  const auto backend = MakeCpuBackend(2);
  const auto measure = [&](const CoverageOptions& options) {
    return MeasureCoverage(*backend, scene.capture, OwnMasks(scene.capture),
                           testing::PointGaussians(scene.capture, 0.2f), options);
  };
  EXPECT_THAT(measure({}).confidence, IsEmpty());
  EXPECT_THAT(measure({}).uncovered, IsEmpty());
  EXPECT_THAT(measure({.find_uncovered = true}).confidence, IsEmpty());
  EXPECT_THAT(measure({.min_confident_views = 3}).uncovered, IsEmpty());
  const GaussianCoverage both = measure({.min_confident_views = 3, .find_uncovered = true});
  EXPECT_THAT(both.confidence, ElementsAre(1, 1));
  EXPECT_EQ(both.uncovered.size(), 4u);
}

}  // namespace
}  // namespace pepeseg
