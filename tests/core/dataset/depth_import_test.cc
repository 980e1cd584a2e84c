#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "core/dataset/import.h"
#include "core/dataset/view_warp.h"
#include "tests/testing/float_files.h"
#include "tests/testing/small_dataset.h"
#include "tests/testing/status_testing.h"

// How the import warps and normalises depth maps.
namespace pepeseg {
namespace {

using absl::StatusCode::kInvalidArgument;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::IsNan;
using testing::SmallDataset;
using testing::WriteBytes;

constexpr float kNoDepth = std::numeric_limits<float>::quiet_NaN();

// Returns a map that rises to the right from 1 to 41, by 1 per pixel of a photograph 40 pixels
// wide.
FloatImage Ramp(int width, int height) {
  FloatImage map{width, height, {}};
  for (int i = 0; i < width * height; ++i) {
    map.values.push_back(1 + static_cast<float>(i % width) * 40 / static_cast<float>(width));
  }
  return map;
}

ViewWarp PinholeWarp(int width, int height, double image_scale) {
  Lens lens{.model = LensModel::kPinhole, .width = width, .height = height};
  lens.fx = lens.fy = 50, lens.cx = width / 2.0, lens.cy = height / 2.0;
  return *ViewWarp::Create(lens, image_scale);
}

TEST(WarpedDepth, EqualsTheMapForAPinholeOfItsSize) {
  FloatImage map = Ramp(6, 4);
  map.values[7] = kNoDepth;
  const std::vector<float> depth = PinholeWarp(6, 4, 1).Depth(map);
  ASSERT_EQ(depth.size(), map.values.size());
  for (size_t i = 0; i < depth.size(); ++i) {
    if (i == 7) {
      EXPECT_THAT(depth[i], IsNan());
    } else {
      EXPECT_EQ(depth[i], map.values[i]) << i;
    }
  }
}

TEST(WarpedDepth, AveragesTheKnownOfFourPixelsAtHalfSize) {
  // The pixel at the lower right of the result's centre counts as the nearest: it decides whether
  // the result is known.
  const FloatImage map = {4,
                          4,
                          {1, 2, 5, 5,                //
                           3, 4, 5, kNoDepth,         //
                           kNoDepth, 8, 9, kNoDepth,  //
                           8, 8, kNoDepth, 9}};
  EXPECT_THAT(PinholeWarp(4, 4, 0.5).Depth(map), ElementsAre(2.5f, IsNan(), 8, 9));
}

TEST(WarpedDepth, InterpolatesASmallerMap) {
  const std::vector<float> depth = PinholeWarp(8, 2, 1).Depth({4, 1, {0, 4, 8, 12}});
  EXPECT_THAT(std::vector<float>(depth.begin(), depth.begin() + 8),
              ElementsAre(0, 1, 3, 5, 7, 9, 11, 12));
}

TEST(WarpedDepth, NeverMixesUnknownValuesIn) {
  FloatImage map = Ramp(10, 8);
  map.values[23] = map.values[24] = map.values[77] = kNoDepth;
  const std::vector<float> depth = PinholeWarp(33, 26, 1).Depth(map);
  int num_unknown = 0;
  for (int i = 0; i < 33 * 26; ++i) {
    const int x = (2 * (i % 33) + 1) * 10 / 66, y = (2 * (i / 33) + 1) * 8 / 52;
    const bool unknown = std::isnan(map.values[y * 10 + x]);
    num_unknown += unknown ? 1 : 0;
    ASSERT_EQ(std::isnan(depth[i]), unknown) << i;
    if (unknown) continue;
    // A missing neighbour shifts the sample by at most half a pixel of the ramp.
    const double place = (i % 33 + 0.5) / 33 * 10 - 0.5;
    ASSERT_NEAR(depth[i], 1 + 4 * place, 2.01) << i;
  }
  EXPECT_GT(num_unknown, 20);
}

TEST(WarpedDepth, FollowsTheLensLikeThePhotograph) {
  Lens lens{.model = LensModel::kRadial, .width = 160, .height = 120};
  lens.fx = 120, lens.fy = 122, lens.cx = 83, lens.cy = 57;
  lens.distortion[0] = 0.2, lens.distortion[1] = -0.03;
  for (const double image_scale : {1.0, 0.4}) {
    ASSERT_OK_AND_ASSIGN(const ViewWarp warp, ViewWarp::Create(lens, image_scale));
    const Camera& camera = warp.camera();
    const std::vector<float> depth = warp.Depth(Ramp(160, 120));  // 0.25 a pixel from 1
    double worst = 0;
    for (int y = 0; y < camera.height; ++y) {
      for (int x = 0; x < camera.width; ++x) {
        const Eigen::Vector2d ray((x + 0.5 - camera.cx) / camera.fx,
                                  (y + 0.5 - camera.cy) / camera.fy);
        const double place = lens.Project(ray).x();
        if (place < 0.5 || place > 159.5) continue;
        const double off = depth[y * camera.width + x] - (1 + 0.25 * (place - 0.5));
        worst = std::max(worst, std::abs(off) / 0.25);
      }
    }
    EXPECT_LT(worst, 0.1) << image_scale;  // pixels of the photograph
  }
}

TEST(DepthImport, ReadsTheSensorDepthOfTheShippedScene) {
  ASSERT_OK_AND_ASSIGN(const auto files, ListDataset(PEPESEG_TEST_DATA "/apc_shelf"));
  ASSERT_OK_AND_ASSIGN(const Capture capture, ImportCapture(files, {.image_scale = 0.5}));
  for (const View& view : capture.views) {
    EXPECT_EQ(view.depth.kind, DepthPrior::Kind::kDepth);
    ASSERT_EQ(view.depth.values.size(), 320u * 240);
    int num_known = 0;
    for (const float value : view.depth.values) {
      if (std::isnan(value)) continue;
      ++num_known;
      ASSERT_TRUE(value >= 0 && value <= 1) << value;
    }
    // The sensor covers a quarter of the shelf; ignored pixels are unknown as well.
    EXPECT_GT(num_known, 320 * 240 / 6) << view.name;
    EXPECT_LT(num_known, 320 * 240 / 3) << view.name;
  }
}

// Returns the correlation of the depths of COLMAP's points in a view with the view's map, or with
// its mirror image.
double CorrelationWithPoints(const Capture& capture, const View& view, bool mirrored) {
  double n = 0, x = 0, y = 0, xx = 0, xy = 0, yy = 0;
  for (const ScenePoint& point : capture.points) {
    const Eigen::Vector3d p = view.cam_from_world * point.position.cast<double>();
    const auto u = static_cast<int>(std::floor(view.camera.fx * p.x() / p.z() + view.camera.cx));
    const auto v = static_cast<int>(std::floor(view.camera.fy * p.y() / p.z() + view.camera.cy));
    if (p.z() <= 0 || u < 0 || u >= 640 || v < 0 || v >= 480) continue;
    const double a = p.z(), b = view.depth.values[v * 640 + (mirrored ? 639 - u : u)];
    if (std::isnan(b)) continue;
    n += 1, x += a, y += b, xx += a * a, xy += a * b, yy += b * b;
  }
  return (n * xy - x * y) / std::sqrt((n * xx - x * x) * (n * yy - y * y));
}

TEST(DepthImport, AgreesWithTheDepthsOfThePoints) {
  ASSERT_OK_AND_ASSIGN(const auto files, ListDataset(PEPESEG_TEST_DATA "/apc_shelf"));
  ASSERT_OK_AND_ASSIGN(const Capture capture, ImportCapture(files, {}));
  // A point that a product occludes is compared with the depth of the product, so the correlation
  // is not perfect.
  double right = 0, mirrored = 0;
  for (const View& view : capture.views) {
    right += CorrelationWithPoints(capture, view, false) / 15;
    mirrored += CorrelationWithPoints(capture, view, true) / 15;
  }
  EXPECT_GT(right, 0.75);
  EXPECT_LT(mirrored, 0.35);
}

TEST(DepthImport, DerivesTheKindFromTheFolder) {
  SmallDataset dataset;
  dataset.Write();
  WriteBytes(dataset.folder / "disparity/a.npy", testing::Npy(Ramp(80, 60)));
  WriteBytes(dataset.folder / "depth/sub/c.pfm", testing::Pfm(Ramp(40, 30)));
  ASSERT_OK_AND_ASSIGN(const Capture capture, dataset.Import());
  EXPECT_EQ(capture.views[0].depth.kind, DepthPrior::Kind::kDisparity);
  EXPECT_EQ(capture.views[0].depth.values.size(), 1200u);
  EXPECT_THAT(capture.views[1].depth.values, IsEmpty());
  EXPECT_EQ(capture.views[2].depth.kind, DepthPrior::Kind::kDepth);
  EXPECT_EQ(capture.views[2].depth.values[0], 0);
  EXPECT_EQ(capture.views[2].depth.values[39], 1);
  EXPECT_THAT(capture.warnings, ElementsAre(HasSubstr("grow towards"), HasSubstr("grow away")));
}

TEST(DepthImport, WarnsOfMapsWithoutInformation) {
  SmallDataset dataset;
  dataset.Write();
  const std::vector<float> zeros(1200, 0.0f), ones(1200, 1.0f);
  WriteBytes(dataset.folder / "depth/a.npy", testing::Npy({40, 30, zeros}));
  WriteBytes(dataset.folder / "depth/b.npy", testing::Npy({40, 30, ones}));
  WriteBytes(dataset.folder / "depth/x.npy", testing::Npy({40, 30, ones}));
  ASSERT_OK_AND_ASSIGN(const Capture capture, dataset.Import());
  for (const View& view : capture.views) EXPECT_THAT(view.depth.values, IsEmpty());
  EXPECT_THAT(capture.warnings,
              ElementsAre(HasSubstr("1 depth maps belong to no view and are left out: depth/x.npy"),
                          HasSubstr("left out: depth/a.npy, depth/b.npy")));
}

TEST(DepthImport, RejectsInvalidMapsByName) {
  SmallDataset dataset;
  dataset.Write();
  WriteBytes(dataset.folder / "depth/a.npy", testing::Npy(Ramp(30, 40)));
  EXPECT_STATUS(dataset.Import(), kInvalidArgument,
                "depth/a.npy: has 30x40 pixels, its photograph images/a.jpg 40x30");
  WriteBytes(dataset.folder / "depth/a.npy", testing::Npy(Ramp(40, 30)).substr(0, 3000));
  EXPECT_STATUS(dataset.Import(), kInvalidArgument, "depth/a.npy: cut short");
  WriteBytes(dataset.folder / "disparity/a.pfm", testing::Pfm(Ramp(40, 30)));
  EXPECT_STATUS(dataset.Import(), kInvalidArgument,
                "two depth maps for a: depth/a.npy and disparity/a.pfm");
}

}  // namespace
}  // namespace pepeseg
