#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <string>

#include "core/dataset/view_warp.h"
#include "core/query/frame.h"
#include "tests/core/query/warped_view.h"
#include "tests/testing/lens_cases.h"
#include "tests/testing/status_testing.h"

namespace pepeseg {
namespace {

using Eigen::Vector2d;
using testing::DistortingLenses;
using testing::LensCase;
using testing::WarpedView;

Lens Pinhole(int width, int height) {
  Lens lens{.model = LensModel::kPinhole, .width = width, .height = height};
  lens.fx = lens.fy = 120, lens.cx = width / 2.0, lens.cy = height / 2.0;
  return lens;
}

BinaryMask Draw(int width, int height, const std::function<bool(double, double)>& inside) {
  BinaryMask mask;
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) mask.pixels.push_back(inside(x + 0.5, y + 0.5) ? 1 : 0);
  }
  return mask;
}

double IouOf(const BinaryMask& a, const BinaryMask& b) {
  double both = 0, either = 0;
  for (size_t i = 0; i < a.pixels.size(); ++i) {
    both += a.pixels[i] & b.pixels[i];
    either += a.pixels[i] | b.pixels[i];
  }
  return both / either;
}

BinaryMask TakeToView(const BinaryMask& mask, const Frame& frame) {
  BinaryMask in_view;
  for (const int32_t pixel : frame.PixelsOfView()) in_view.pixels.push_back(mask.pixels[pixel]);
  return in_view;
}

TEST(MaskFromView, IsTheMaskWhereThePhotographIsOnlyTurned) {
  const ModelView view = WarpedView(Pinhole(40, 30), 1, 3);
  const BinaryMask mask = Draw(40, 30, [](double x, double y) { return x < 12 && y < 2 * x; });
  BinaryMask turned = mask;
  std::reverse(turned.pixels.begin(), turned.pixels.end());
  // Single pixels that stick out are smoothed away.
  EXPECT_GT(IouOf(Frame(view).FromView(mask), turned), 0.97);
}

TEST(MaskFromView, EnlargedHasSmootherEdgesThanThePixelsOfTheView) {
  const auto disc = [](double x, double y) { return std::hypot(x - 81, y - 58) < 33.3; };
  const auto stripe = [](double x, double y) { return std::abs(0.4 * x - y + 20) < 9; };
  const ModelView view = WarpedView(Pinhole(160, 120), 0.25);
  for (const std::function<bool(double, double)>& shape :
       {std::function<bool(double, double)>(disc), std::function<bool(double, double)>(stripe)}) {
    const BinaryMask truth = Draw(160, 120, shape);
    const BinaryMask in_view = TakeToView(truth, Frame(view));
    const BinaryMask nearest = Draw(160, 120, [&](double x, double y) {
      return in_view.pixels[static_cast<size_t>(y / 4) * 40 + static_cast<size_t>(x / 4)] != 0;
    });
    const double smooth = IouOf(Frame(view).FromView(in_view), truth);
    // Measured: 0.81 of the error for the disc, 0.69 for the stripe.
    EXPECT_LT(1 - smooth, 0.85 * (1 - IouOf(nearest, truth)));
  }
}

TEST(MaskFromView, SurvivesThereAndBackThroughEveryLens) {
  for (const LensCase& c : DistortingLenses()) {
    for (const int orientation : {1, 6}) {
      SCOPED_TRACE(std::string(NameOf(c.model)));
      const ModelView view = WarpedView(c.MakeLens(), 0.5, orientation);
      const Frame frame(view);
      const double x0 = frame.width() / 2.0, y0 = frame.height() / 2.0;
      const BinaryMask truth = Draw(frame.width(), frame.height(), [&](double x, double y) {
        return std::hypot(x - x0, y - y0) < 40;
      });
      const BinaryMask back = frame.FromView(TakeToView(truth, frame));
      EXPECT_GT(IouOf(back, truth), 0.96);
    }
  }
}

TEST(MaskFromView, IsEmptyOutsideTheView) {
  const ModelView view = WarpedView(DistortingLenses()[0].MakeLens(), 1);
  const BinaryMask all = {
      std::vector<uint8_t>(static_cast<size_t>(view.camera.width) * view.camera.height, 1)};
  const BinaryMask mask = Frame(view).FromView(all);
  EXPECT_EQ(mask.pixels.front(), 0);
  EXPECT_EQ(mask.pixels.back(), 0);
  EXPECT_EQ(mask.pixels[60 * 160 + 80], 1);
}

TEST(ResultFromView, MeasuresTheMaskAgain) {
  const ModelView view = WarpedView(Pinhole(40, 30), 0.5);
  SegmentResult result;
  result.width = 20;
  result.height = 15;
  result.mask = Draw(20, 15, [](double x, double y) { return x > 4 && x < 10 && y > 3 && y < 9; });
  result.similarity.assign(300, 0.25f);
  result.score = 0.75;
  const SegmentResult mapped = Frame(view).FromView(result);
  EXPECT_EQ(mapped.width, 40);
  EXPECT_EQ(mapped.height, 30);
  // Corners are rounded.
  EXPECT_NEAR(static_cast<double>(mapped.area), 144, 8);
  EXPECT_EQ(std::vector<int>(mapped.box, mapped.box + 4), (std::vector<int>{8, 6, 12, 12}));
  EXPECT_EQ(mapped.similarity, std::vector<float>(1200, 0.25f));
  EXPECT_EQ(mapped.score, 0.75);
}

TEST(ImageFromView, AreThePhotographThatWasUndistorted) {
  for (const LensCase& c : DistortingLenses()) {
    SCOPED_TRACE(std::string(NameOf(c.model)));
    const Lens lens = c.MakeLens();
    ASSERT_OK_AND_ASSIGN(const ViewWarp warp, ViewWarp::Create(lens, 1));
    Image photo{lens.width, lens.height, 3, {}};
    for (int y = 0; y < lens.height; ++y) {
      for (int x = 0; x < lens.width; ++x) {
        const double value = 127.5 + 60 * std::sin(x / 20.0) + 60 * std::cos(y / 15.0);
        photo.pixels.insert(photo.pixels.end(), 3, static_cast<uint8_t>(std::lround(value)));
      }
    }
    const ModelView view = WarpedView(lens, 1);
    const Image back = Frame(view).FromView(warp.Photo(photo));
    ASSERT_EQ(back.pixels.size(), photo.pixels.size());
    int num_shown = 0;
    for (size_t i = 0; i < photo.pixels.size(); ++i) {
      if (back.pixels[i] == 0) continue;  // 0: not shown; the photograph has no value under 7
      ++num_shown;
      EXPECT_NEAR(back.pixels[i], photo.pixels[i], 6) << i;
    }
    EXPECT_GT(num_shown, 160 * 120 * 3 / 2);
  }
}

TEST(NearestFromView, MixesNoValues) {
  const ModelView view = WarpedView(DistortingLenses()[2].MakeLens(), 0.5);
  std::vector<int32_t> ids;
  for (int i = 0; i < view.camera.width * view.camera.height; ++i)
    ids.push_back(i % 2 == 0 ? 7 : 9);
  int other = 0;
  for (const int32_t id : Frame(view).NearestFromView(ids)) {
    other += id != 0 && id != 7 && id != 9 ? 1 : 0;
  }
  EXPECT_EQ(other, 0);
}

}  // namespace
}  // namespace pepeseg
