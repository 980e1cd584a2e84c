#include "core/render/renderer.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <memory>

#include "core/base/device_lock.h"
#include "tests/testing/point_gaussians.h"
#include "tests/testing/status_testing.h"
#include "tests/testing/synthetic_capture.h"

namespace pepeseg {
namespace {

struct Entry {
  int32_t gaussian;
  float weight;
};

// Returns the id of a pixel that shows these entries.
int32_t Show(const std::vector<Entry>& entries, const std::vector<int32_t>& ids) {
  PixelRows rows;
  rows.first = {0, static_cast<int32_t>(entries.size())};
  for (const Entry& entry : entries) {
    rows.gaussian.push_back(entry.gaussian);
    rows.weight.push_back(entry.weight);
  }
  return IdsOfRows(rows, ids).at(0);
}

TEST(IdsOfRows, ReturnsTheIdWithTheLargestSumOfWeights) {
  const std::vector<int32_t> ids = {4, 2, 2, 0};
  EXPECT_EQ(Show({{0, 0.35f}, {1, 0.2f}, {2, 0.2f}, {3, 0.2f}}, ids), 2);
  EXPECT_EQ(Show({{0, 0.45f}, {1, 0.2f}, {2, 0.2f}}, ids), 4);
  EXPECT_EQ(Show({{0, 0.25f}, {1, 0.25f}}, ids), 2);
}

TEST(IdsOfRows, ReturnsZeroWithLittleWeightOrInNoSegment) {
  const std::vector<int32_t> ids = {4, 0};
  EXPECT_EQ(Show({{0, 0.49f}}, ids), 0);
  EXPECT_EQ(Show({{0, 0.3f}, {1, 0.4f}}, ids), 0);
  EXPECT_EQ(Show({}, ids), 0);
}

TEST(IdsOfRows, ReturnsNothingForNoRows) {
  EXPECT_TRUE(IdsOfRows(PixelRows{}, std::vector<int32_t>{1}).empty());
}

TEST(Renderer, RendersTheDepthOfASurface) {
  // One large opaque Gaussian at depth 3.
  Capture capture;
  capture.points.push_back({Eigen::Vector3f(0, 0, 3), {200, 100, 50}});
  View view;
  view.camera = {32, 32, 30, 30, 16, 16};
  const auto backend = MakeCpuBackend(1);
  Renderer renderer(*backend, testing::PointGaussians(capture, 0.4f), 1);
  const std::vector<float> depth = renderer.Depth(view);
  EXPECT_NEAR(depth[16 * 32 + 16], 3, 1e-4);
  EXPECT_EQ(depth[0], 0);
}

// The renders of a synthetic scene of many overlapping Gaussians.
class RendererOfScene : public ::testing::Test {
 protected:
  RendererOfScene()
      : capture_(testing::MakeSyntheticScene({.num_views = 2}).capture),
        backend_(MakeCpuBackend(2)) {
    model_.gaussians = testing::PointGaussians(capture_, 0.1f);
  }
  std::vector<int32_t> EveryPixel() const { return GridPixels(capture_.views[0].camera, 1e9); }

  Capture capture_;
  Model model_;
  std::unique_ptr<Backend> backend_;
};

TEST_F(RendererOfScene, GeometryAloneHasTheRowsOfTheModel) {
  Renderer geometry(*backend_, model_.gaussians, model_.scene_radius);
  Renderer whole(*backend_, model_);
  const std::vector<int32_t> pixels = EveryPixel();
  const View& view = capture_.views[0];
  const PixelRows rows = ToHost(whole.Rows(view, pixels));
  EXPECT_EQ(rows.num_rows(), pixels.size());
  EXPECT_FALSE(rows.weight.empty());
  // A render with depth before it changes nothing.
  const std::vector<float> depth = geometry.Depth(view);
  EXPECT_EQ(depth, whole.Depth(view));
  const PixelRows same = ToHost(geometry.Rows(view, pixels));
  EXPECT_EQ(rows.first, same.first);
  EXPECT_EQ(rows.gaussian, same.gaussian);
  EXPECT_EQ(rows.weight, same.weight);
}

TEST_F(RendererOfScene, IdsOfBandsAreThoseOfTheRows) {
  Renderer renderer(*backend_, model_);
  // More pixels than one band has.
  View view = capture_.views[0];
  const double factor = 900.0 / view.camera.width;
  view.camera.width = 900;
  view.camera.height = 700;
  for (double* value : {&view.camera.fx, &view.camera.fy, &view.camera.cx, &view.camera.cy}) {
    *value *= factor;
  }
  std::vector<int32_t> ids(static_cast<size_t>(model_.gaussians.count));
  for (size_t i = 0; i < ids.size(); ++i) ids[i] = static_cast<int32_t>(i % 5);
  const std::vector<int32_t> image = renderer.Ids(view, ids);
  ASSERT_EQ(image.size(), size_t{900} * 700);
  std::vector<int32_t> last_row;
  for (int x = 0; x < 900; ++x) last_row.push_back(699 * 900 + x);
  const std::vector<int32_t> of_last = IdsOfRows(ToHost(renderer.Rows(view, last_row)), ids);
  EXPECT_EQ(std::vector<int32_t>(image.end() - 900, image.end()), of_last);
  EXPECT_GT(*std::max_element(image.begin(), image.end()), 0);
}

TEST_F(RendererOfScene, RendersAllGaussiansAfterASubset) {
  Renderer renderer(*backend_, model_);
  const View& view = capture_.views[0];
  const Image all = renderer.Color(view);
  GaussianSet none;
  none.member.assign(static_cast<size_t>(model_.gaussians.count), 0);
  const Image empty = renderer.Color(view, &none);
  EXPECT_EQ(*std::max_element(empty.pixels.begin(), empty.pixels.end()), 0);
  EXPECT_EQ(renderer.Color(view).pixels, all.pixels);
  EXPECT_OK(TakeStatus(*backend_));
}

}  // namespace
}  // namespace pepeseg
