#include "core/render/weight_sums.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <memory>

#include "tests/testing/point_gaussians.h"

namespace pepeseg {
namespace {

// Returns a view from the origin along z that sees 45 degrees to each side.
View WideView(int width, int height) {
  View view;
  view.camera = {width, height, 0.5 * width, 0.5 * height, 0.5 * width, 0.5 * height};
  return view;
}

TEST(WeightView, IsTheViewItselfUpToTheLimit) {
  const View view = WideView(512, 512);
  const WeightView shrunk(view);
  EXPECT_EQ(shrunk.viewpoint().camera, view.camera);
  const std::vector<int32_t> pixels = shrunk.FullPixels();
  ASSERT_EQ(pixels.size(), 512u * 512);
  for (int32_t p = 0; p < shrunk.num_pixels(); p += 1001) {
    EXPECT_EQ(pixels[p], p);
    EXPECT_EQ(shrunk.PixelAt(p), p);
  }
}

TEST(WeightView, HasTheFieldOfViewAndAtMostTheLimitOfPixels) {
  for (const auto& [width, height] :
       {std::pair{513, 512}, {4000, 3001}, {16384, 16384}, {1'000'003, 1}, {1, 1'000'003}}) {
    const View view = WideView(width, height);
    const WeightView shrunk(view);
    const Camera& camera = shrunk.viewpoint().camera;
    EXPECT_LE(int64_t{camera.width} * camera.height, kMaxWeightPixels);
    EXPECT_GE(int64_t{camera.width} * camera.height, kMaxWeightPixels * 99 / 100);
    EXPECT_DOUBLE_EQ(camera.fx, 0.5 * camera.width);
    EXPECT_DOUBLE_EQ(camera.fy, 0.5 * camera.height);
    EXPECT_DOUBLE_EQ(camera.cx, 0.5 * camera.width);
    EXPECT_DOUBLE_EQ(camera.cy, 0.5 * camera.height);
  }
}

TEST(WeightView, MapsPixelsToThoseAtTheSamePlace) {
  const WeightView shrunk(WideView(2000, 1500));
  const Camera& camera = shrunk.viewpoint().camera;
  const std::vector<int32_t> pixels = shrunk.FullPixels();
  ASSERT_EQ(pixels.size(), static_cast<size_t>(shrunk.num_pixels()));
  for (int32_t p = 0; p < shrunk.num_pixels(); p += 777) {
    EXPECT_EQ(shrunk.PixelAt(pixels[p]), p);
    const double x = (p % camera.width + 0.5) * 2000 / camera.width;
    const double y = static_cast<double>(p / camera.width + 0.5) * 1500 / camera.height;
    EXPECT_NEAR(pixels[p] % 2000 + 0.5, x, 0.5001);
    EXPECT_NEAR(pixels[p] / 2000 + 0.5, y, 0.5001);
  }
  EXPECT_EQ(shrunk.PixelAt(0), 0);
  EXPECT_EQ(shrunk.PixelAt(2000 * 1500 - 1), shrunk.num_pixels() - 1);
}

// Two Gaussians side by side, one to the left and one to the right.
class WeightSumsOfTwo : public ::testing::Test {
 protected:
  WeightSumsOfTwo() {
    Capture capture;
    capture.points.push_back({Eigen::Vector3f(-1, 0, 3), {200, 100, 50}});
    capture.points.push_back({Eigen::Vector3f(1, 0, 3), {200, 100, 50}});
    renderer_ = std::make_unique<Renderer>(*backend_, testing::PointGaussians(capture, 0.2f), 1);
  }

  // Returns the sums over all pixels and over those of the left half, after two calls of Measure.
  std::vector<float> SumsOfLeftHalf(const WeightView& view) {
    const int width = view.viewpoint().camera.width;
    std::vector<uint8_t> all(view.num_pixels(), 1), left(view.num_pixels());
    for (int32_t p = 0; p < view.num_pixels(); ++p) left[p] = p % width < width / 2 ? 1 : 0;
    WeightSums sums(*renderer_);
    Buffer<float> added(*backend_, 4);
    for (int k = 0; k < 2; ++k) {
      sums.Measure(view, std::vector{all, left});
      sums.AddTo(added.span(), 2);
    }
    std::vector<float> host(4);
    added.Download(std::span<float>(host));
    return host;
  }

  std::unique_ptr<Backend> backend_ = MakeCpuBackend(2);
  std::unique_ptr<Renderer> renderer_;
};

TEST_F(WeightSumsOfTwo, AddsTheWeightsUnderEachMask) {
  const View view = WideView(60, 60);
  const std::vector<float> sums = SumsOfLeftHalf(WeightView(view));
  const PixelRows rows = ToHost(renderer_->Rows(view, GridPixels(view.camera, 1e9)));
  float want[2] = {};
  for (size_t e = 0; e < rows.gaussian.size(); ++e) want[rows.gaussian[e]] += rows.weight[e];
  EXPECT_GT(want[0], 10);
  for (int i = 0; i < 2; ++i) EXPECT_NEAR(sums[i], 2 * want[i], 1e-3);
  EXPECT_NEAR(sums[2], 2 * want[0], 1e-3) << "the left one is in the left half";
  EXPECT_EQ(sums[3], 0) << "the right one is not";
}

TEST_F(WeightSumsOfTwo, GivesTheSameShareOfThePixelsOfALargeView) {
  const WeightView small(WideView(400, 400)), shrunk(WideView(3000, 2000));
  const std::vector<float> want = SumsOfLeftHalf(small), got = SumsOfLeftHalf(shrunk);
  ASSERT_GT(want[0], 0);
  for (int i = 0; i < 4; ++i) {
    EXPECT_NEAR(got[i] / static_cast<float>(shrunk.num_pixels()),
                want[i] / static_cast<float>(small.num_pixels()), 1e-5)
        << i;
  }
}

}  // namespace
}  // namespace pepeseg
