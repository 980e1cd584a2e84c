#include "core/dataset/view_warp.h"

#include <gtest/gtest.h>

#include <Eigen/LU>
#include <array>
#include <cmath>
#include <string>
#include <vector>

#include "tests/testing/lens_cases.h"
#include "tests/testing/status_testing.h"

namespace pepeseg {
namespace {

using Eigen::Vector2d;
using testing::DistortingLenses;
using testing::LensCase;

constexpr int kWidth = 160;
constexpr int kHeight = 120;

// The scene: a smooth brightness for every ray.
double Brightness(const Vector2d& ray) {
  return 127.5 + 50 * std::sin(6 * ray.x()) + 50 * std::cos(5 * ray.y() + ray.x());
}

// Returns the ray that the lens projects to the pixel's centre, by Newton's method.
Vector2d RayThrough(const Lens& lens, const Vector2d& pixel) {
  Vector2d ray((pixel.x() - lens.cx) / lens.fx, (pixel.y() - lens.cy) / lens.fy);
  for (int i = 0; i < 30; ++i) {
    constexpr double kStep = 1e-6;
    Eigen::Matrix2d jacobian;
    for (int k = 0; k < 2; ++k) {
      const Vector2d step = Vector2d::Unit(k) * kStep;
      jacobian.col(k) = (lens.Project(ray + step) - lens.Project(ray - step)) / (2 * kStep);
    }
    ray -= jacobian.inverse() * (lens.Project(ray) - pixel);
  }
  return ray;
}

Image Photograph(const Lens& lens) {
  Image image{kWidth, kHeight, 3, {}};
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      const double value = Brightness(RayThrough(lens, {x + 0.5, y + 0.5}));
      image.pixels.insert(image.pixels.end(), 3, static_cast<uint8_t>(std::lround(value)));
    }
  }
  return image;
}

Vector2d PinholeRay(const Camera& camera, int x, int y) {
  return {(x + 0.5 - camera.cx) / camera.fx, (y + 0.5 - camera.cy) / camera.fy};
}

TEST(ViewWarp, UndistortsThePhotograph) {
  for (const LensCase& c : DistortingLenses()) {
    SCOPED_TRACE(std::string(NameOf(c.model)));
    const Lens lens = c.MakeLens();
    ASSERT_OK_AND_ASSIGN(const ViewWarp warp, ViewWarp::Create(lens, 1.0));
    const Camera& camera = warp.camera();
    EXPECT_EQ(camera.fx, lens.fx);
    EXPECT_EQ(camera.fy, lens.fy);
    EXPECT_GE(camera.width, kWidth * 3 / 4);
    EXPECT_GE(camera.height, kHeight * 3 / 4);
    const Image photo = warp.Photo(Photograph(lens));
    ASSERT_EQ(photo.width, camera.width);
    ASSERT_EQ(photo.height, camera.height);
    // A quarter of a pixel off would be 0.6 grey levels on average, and not centring pixels half.
    double error = 0, worst = 0;
    for (int y = 0; y < camera.height; ++y) {
      for (int x = 0; x < camera.width; ++x) {
        const double expected = Brightness(PinholeRay(camera, x, y));
        const double off = std::abs(photo.pixels[3 * (y * camera.width + x)] - expected);
        error += off / (camera.width * camera.height);
        worst = std::max(worst, off);
      }
    }
    EXPECT_LT(error, 0.4);
    EXPECT_LT(worst, 3);
  }
}

TEST(ViewWarp, WarpsMasksAndIgnoreMaskAlike) {
  for (const LensCase& c : DistortingLenses()) {
    SCOPED_TRACE(std::string(NameOf(c.model)));
    const Lens lens = c.MakeLens();
    const auto inside = [](const Vector2d& ray) { return ray.x() > -0.2 && ray.y() > 0.1; };
    BinaryMask mask;
    for (int y = 0; y < kHeight; ++y) {
      for (int x = 0; x < kWidth; ++x) {
        mask.pixels.push_back(inside(RayThrough(lens, {x + 0.5, y + 0.5})) ? 1 : 0);
      }
    }
    ASSERT_OK_AND_ASSIGN(const ViewWarp warp, ViewWarp::Create(lens, 1.0));
    const Camera& camera = warp.camera();
    const MaskSet masks = warp.Masks(BuildMaskSet(kWidth, kHeight, std::vector{mask}));
    const std::vector<uint8_t> ignore = warp.Ignore(mask.pixels);
    ASSERT_EQ(masks.num_masks, 1);
    int wrong = 0;
    for (int y = 0; y < camera.height; ++y) {
      for (int x = 0; x < camera.width; ++x) {
        const Vector2d ray = PinholeRay(camera, x, y);
        const bool near_border = std::abs(ray.x() + 0.2) < 0.01 || std::abs(ray.y() - 0.1) < 0.01;
        if (near_border) continue;
        wrong += masks.Covers(0, x, y) != inside(ray) ? 1 : 0;
        wrong += (ignore[y * camera.width + x] != 0) != inside(ray) ? 1 : 0;
      }
    }
    EXPECT_EQ(wrong, 0);
  }
}

TEST(ViewWarp, WarpsMasksOfAnotherSize) {
  constexpr int kFiner = 2;
  const Lens lens = DistortingLenses()[0].MakeLens();
  const auto inside = [](const Vector2d& ray) { return ray.x() > -0.2 && ray.y() > 0.1; };
  BinaryMask mask;
  for (int y = 0; y < kHeight * kFiner; ++y) {
    for (int x = 0; x < kWidth * kFiner; ++x) {
      const Vector2d pixel((x + 0.5) / kFiner, (y + 0.5) / kFiner);
      mask.pixels.push_back(inside(RayThrough(lens, pixel)) ? 1 : 0);
    }
  }
  ASSERT_OK_AND_ASSIGN(const ViewWarp warp, ViewWarp::Create(lens, 1.0));
  const MaskSet masks =
      warp.Masks(BuildMaskSet(kWidth * kFiner, kHeight * kFiner, std::vector{mask}));
  ASSERT_EQ(masks.num_masks, 1);
  int wrong = 0;
  for (int y = 0; y < warp.camera().height; ++y) {
    for (int x = 0; x < warp.camera().width; ++x) {
      const Vector2d ray = PinholeRay(warp.camera(), x, y);
      const bool near_border = std::abs(ray.x() + 0.2) < 0.01 || std::abs(ray.y() - 0.1) < 0.01;
      wrong += !near_border && masks.Covers(0, x, y) != inside(ray) ? 1 : 0;
    }
  }
  EXPECT_EQ(wrong, 0);
}

TEST(ViewWarp, ShrinksAnUndistortedPhotograph) {
  const Lens lens = DistortingLenses()[2].MakeLens();
  ASSERT_OK_AND_ASSIGN(const ViewWarp warp, ViewWarp::Create(lens, 0.3));
  const Camera& camera = warp.camera();
  const Image photo = warp.Photo(Photograph(lens));
  double worst = 0;
  for (int y = 0; y < camera.height; ++y) {
    for (int x = 0; x < camera.width; ++x) {
      const double expected = Brightness(PinholeRay(camera, x, y));
      worst = std::max(worst, std::abs(photo.pixels[3 * (y * camera.width + x)] - expected));
    }
  }
  EXPECT_LT(worst, 3);
}

TEST(ViewWarp, ChangesNothingForAPinhole) {
  Lens lens{.model = LensModel::kPinhole, .width = kWidth, .height = kHeight};
  lens.fx = 120, lens.fy = 122, lens.cx = 83, lens.cy = 57;
  ASSERT_OK_AND_ASSIGN(const ViewWarp warp, ViewWarp::Create(lens, 1.0));
  const Image photo = Photograph(lens);
  EXPECT_EQ(warp.Photo(photo).pixels, photo.pixels);
  EXPECT_EQ(warp.camera().cx, 83);
}

TEST(ViewWarp, ShowsNothingTwiceWhereThePolynomialFoldsBack) {
  // Beyond a slope of sqrt(1 / 3), the projection of rays moves back towards the centre.
  Lens lens = LensCase{LensModel::kSimpleRadial, {-1.0}}.MakeLens();
  ASSERT_OK_AND_ASSIGN(const ViewWarp warp, ViewWarp::Create(lens, 1.0));
  const Camera& camera = warp.camera();
  for (const int x : {0, camera.width - 1}) {
    for (const int y : {0, camera.height - 1}) {
      EXPECT_LT(PinholeRay(camera, x, y).norm(), std::sqrt(1.0 / 3) + 0.01);
    }
  }
}

TEST(ViewWarp, IsRestoredFromPhotographAndCamera) {
  for (const LensCase& c : DistortingLenses()) {
    SCOPED_TRACE(std::string(NameOf(c.model)));
    const Lens lens = c.MakeLens();
    ASSERT_OK_AND_ASSIGN(const ViewWarp warp, ViewWarp::Create(lens, 0.5));
    const ViewWarp restored = ViewWarp::Restore(warp.photograph(), warp.camera());
    const Image photo = Photograph(lens);
    EXPECT_EQ(restored.Photo(photo).pixels, warp.Photo(photo).pixels);
    EXPECT_EQ(restored.Ignore(photo.pixels), warp.Ignore(photo.pixels));
  }
}

TEST(ViewWarp, RejectsALensThatShowsNothing) {
  Lens lens = LensCase{LensModel::kSimpleRadial, {0.0}}.MakeLens();
  lens.cx = 1e5;
  lens.distortion[0] = 1e8;
  EXPECT_STATUS(ViewWarp::Create(lens, 1.0), absl::StatusCode::kInvalidArgument, "SIMPLE_RADIAL");
}

}  // namespace
}  // namespace pepeseg
