#include "core/query/frame.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numeric>
#include <string>

#include "core/dataset/view_warp.h"
#include "tests/core/query/warped_view.h"
#include "tests/testing/lens_cases.h"
#include "tests/testing/status_testing.h"

namespace pepeseg {
namespace {

using Eigen::Vector2d;
using Eigen::Vector2f;
using testing::DistortingLenses;
using testing::LensCase;
using testing::WarpedView;

Lens Pinhole() {
  Lens lens{.model = LensModel::kPinhole, .width = 160, .height = 120};
  lens.fx = 120, lens.fy = 122, lens.cx = 83, lens.cy = 57;
  return lens;
}

TEST(Frame, IsTheViewWhereNothingWasRecordedOrWarped) {
  ModelView view;
  view.camera = {96, 64, 60, 60, 48, 32};
  const Frame without(view);
  EXPECT_TRUE(without.is_view());
  EXPECT_EQ(without.width(), 96);
  EXPECT_EQ(without.ToView(Vector2d(3.25, 4.5)), Vector2d(3.25, 4.5));
  EXPECT_TRUE(Frame(WarpedView(Pinhole(), 1)).is_view());
  EXPECT_FALSE(Frame(WarpedView(Pinhole(), 0.5)).is_view());
  EXPECT_FALSE(Frame(WarpedView(Pinhole(), 1, 3)).is_view());
  EXPECT_FALSE(Frame(WarpedView(DistortingLenses()[0].MakeLens(), 1)).is_view());
}

TEST(Frame, ScalesWhereTheLensIsStraight) {
  const Frame frame(WarpedView(Pinhole(), 0.5));
  EXPECT_EQ(frame.width(), 160);
  EXPECT_EQ(frame.FromView(Vector2d(40, 30)), Vector2d(80, 60));
  EXPECT_EQ(frame.ToView(Vector2d(159.5, 119.5)), Vector2d(79.75, 59.75));
  EXPECT_FALSE(frame.ToView(Vector2d(160.5, 3)).has_value());
}

TEST(Frame, MapsThereAndBackThroughEveryLens) {
  for (const LensCase& c : DistortingLenses()) {
    for (const int orientation : {1, 6}) {
      SCOPED_TRACE(std::string(NameOf(c.model)));
      const ModelView view = WarpedView(c.MakeLens(), 0.5, orientation);
      const Frame frame(view);
      EXPECT_EQ(frame.width(), orientation == 1 ? 160 : 120);
      for (int y = 0; y < view.camera.height; ++y) {
        for (int x = 0; x < view.camera.width; ++x) {
          const Vector2d place(x + 0.25, y + 0.75);
          const Vector2d in_photograph = frame.FromView(place);
          EXPECT_GE(in_photograph.minCoeff(), 0);
          EXPECT_LE(in_photograph.x(), frame.width());
          EXPECT_LE(in_photograph.y(), frame.height());
          const std::optional<Vector2d> back = frame.ToView(in_photograph);
          ASSERT_TRUE(back.has_value()) << x << " " << y;
          ASSERT_LT((*back - place).norm(), 1e-5) << x << " " << y;
        }
      }
    }
  }
}

TEST(Frame, ShowsNoPlaceThatTheViewLacks) {
  // A barrel lens: a pinhole of its size shows less of the world than the corners do.
  const Frame frame(WarpedView(DistortingLenses()[0].MakeLens(), 1));
  EXPECT_FALSE(frame.ToView(Vector2d(0.5, 0.5)).has_value());
  EXPECT_FALSE(frame.ToView(Vector2d(-5, 60)).has_value());
  EXPECT_TRUE(frame.ToView(Vector2d(80, 60)).has_value());
}

TEST(Frame, ShowsTheSamePixelsAsTheImport) {
  std::vector<Lens> lenses = {Pinhole()};
  for (const LensCase& c : DistortingLenses()) lenses.push_back(c.MakeLens());
  for (const Lens& lens : lenses) {
    for (const double image_scale : {1.0, 0.5, 0.37}) {
      SCOPED_TRACE(std::string(NameOf(lens.model)));
      // Each mask encodes one bit of the pixel's index; together they identify the pixel.
      constexpr int kBits = 15;
      std::vector<BinaryMask> bits(kBits);
      for (int i = 0; i < lens.width * lens.height; ++i) {
        for (int bit = 0; bit < kBits; ++bit) {
          bits[bit].pixels.push_back(static_cast<uint8_t>(i >> bit & 1));
        }
      }
      ASSERT_OK_AND_ASSIGN(const ViewWarp warp, ViewWarp::Create(lens, image_scale));
      const MaskSet warped = warp.Masks(BuildMaskSet(lens.width, lens.height, bits, 1.0));
      ASSERT_EQ(warped.num_masks, kBits);
      const std::vector<int32_t> pixels = Frame(WarpedView(lens, image_scale)).PixelsOfView();
      ASSERT_EQ(pixels.size(), warped.pixel_cell.size());
      for (int i = 0; i < static_cast<int>(pixels.size()); ++i) {
        int32_t expected = 0;
        for (int bit = 0; bit < kBits; ++bit) {
          const bool in = warped.Covers(bit, i % warped.width, i / warped.width);
          expected |= static_cast<int32_t>(in) << bit;
        }
        ASSERT_EQ(pixels[i], expected) << i;
      }
    }
  }
}

TEST(Frame, TurnsThePixelsThatAViewShows) {
  const std::vector<int32_t> pixels = Frame(WarpedView(Pinhole(), 1, 6)).PixelsOfView();
  // 120 pixels wide: the stored first row is at the right.
  EXPECT_EQ(pixels[0], 119);
  EXPECT_EQ(pixels[1], 120 + 119);
  EXPECT_EQ(pixels[160], 118);
}

TEST(Frame, DrawsThePixelsWithinHalfTheWidthOfAStroke) {
  constexpr int kWidth = 40, kHeight = 30;
  ModelView view;
  view.camera = {kWidth, kHeight, 40, 40, 20, 15};
  using Path = std::vector<Eigen::Vector2d>;
  for (const Path& path : {Path{{7.2, 5.1}}, Path{{3, 4}, {36, 9}}, Path{{20, 28}, {22, 1}},
                           Path{{5, 25}, {5, 3}, {38, 3.5}}, Path{{0, 0}, {39.9, 29.9}}}) {
    for (const double thickness : {2.0, 9.0}) {
      const Stroke stroke = {path, true, thickness};
      ASSERT_OK_AND_ASSIGN(const Scribbles drawn, Frame(view).Draw({&stroke, 1}));
      const BinaryMask& mask = drawn.positive;
      for (int pixel = 0; pixel < kWidth * kHeight; ++pixel) {
        const Eigen::Vector2d at(pixel % kWidth + 0.5, pixel / kWidth + 0.5);
        double distance = (at - path[0]).norm();
        for (size_t v = 1; v < path.size(); ++v) {
          const Eigen::Vector2d along = path[v] - path[v - 1];
          const double share =
              std::clamp((at - path[v - 1]).dot(along) / along.squaredNorm(), 0.0, 1.0);
          distance = std::min(distance, (at - path[v - 1] - share * along).norm());
        }
        if (std::abs(distance - thickness / 2) < 1e-9) continue;
        ASSERT_EQ(mask.pixels[pixel] != 0, distance < thickness / 2) << at.transpose();
      }
    }
  }
}

// The thinnest line of a photograph that is eight times as large as the view.
TEST(Frame, DrawsStrokesThatTheViewShows) {
  const ModelView view = WarpedView(Pinhole(), 0.125);
  const Frame frame(view);
  const std::vector<Stroke> strokes = {{{{20, 30}, {140, 90}}, true, 0}, {{{20, 100}}, false, 0}};
  ASSERT_OK_AND_ASSIGN(Scribbles drawn, frame.Draw(strokes));
  EXPECT_EQ(drawn.positive.pixels.size(), size_t{160} * 120);
  ASSERT_OK_AND_ASSIGN(const Prompt taken, frame.ToView(Prompt{view, std::move(drawn)}));
  const auto& shown = std::get<Scribbles>(taken.what);
  const int width = view.camera.width;
  ASSERT_EQ(width, 20);
  for (int x = 3; x < 17; ++x) {  // no gap
    int num_set = 0;
    for (int y = 0; y < view.camera.height; ++y) num_set += shown.positive.pixels[y * width + x];
    EXPECT_GE(num_set, 1) << x;
    EXPECT_LE(num_set, 4) << x;
  }
  EXPECT_EQ(shown.negative.pixels[100 / 8 * width + 20 / 8], 1);
  EXPECT_STATUS(frame.Draw(std::vector<Stroke>{{{{161, 2}}, true, 1}}),
                absl::StatusCode::kInvalidArgument, "point 161,2 is outside");
}

TEST(Frame, TakesABoxToWhatTheViewShowsOfIt) {
  const Frame half(WarpedView(Pinhole(), 0.5));
  const std::optional<BoxPrompt> scaled = half.ToView(BoxPrompt{-10, 20, 50, 40});
  ASSERT_TRUE(scaled.has_value());
  EXPECT_NEAR(scaled->x, 0, 1e-9);
  EXPECT_NEAR(scaled->y, 10, 1e-9);
  EXPECT_NEAR(scaled->width, 20, 1e-9);
  EXPECT_NEAR(scaled->height, 20, 1e-9);
  EXPECT_FALSE(half.ToView(BoxPrompt{170, 20, 5, 5}).has_value());
  EXPECT_FALSE(half.ToView(BoxPrompt{10, 20, 0, 5}).has_value());
  for (const LensCase& c : DistortingLenses()) {
    SCOPED_TRACE(std::string(NameOf(c.model)));
    const ModelView view = WarpedView(c.MakeLens(), 0.5);
    const Frame frame(view);
    for (const BoxPrompt& box :
         {BoxPrompt{50, 30, 40, 50}, BoxPrompt{-20, 70, 90, 80}, BoxPrompt{0, 0, 160, 120}}) {
      const std::optional<BoxPrompt> in_view = frame.ToView(box);
      ASSERT_TRUE(in_view.has_value());
      double left = 1e9, right = -1e9, top = 1e9, bottom = -1e9;
      for (double y = 0; y <= view.camera.height; y += 0.25) {
        for (double x = 0; x <= view.camera.width; x += 0.25) {
          const Vector2d place = frame.FromView(Vector2d(x, y));
          if (place.x() < box.x || place.y() < box.y || place.x() > box.x + box.width ||
              place.y() > box.y + box.height) {
            continue;
          }
          left = std::min(left, x), right = std::max(right, x);
          top = std::min(top, y), bottom = std::max(bottom, y);
        }
      }
      EXPECT_NEAR(in_view->x, left, 0.3);
      EXPECT_NEAR(in_view->y, top, 0.3);
      EXPECT_NEAR(in_view->x + in_view->width, right, 0.3);
      EXPECT_NEAR(in_view->y + in_view->height, bottom, 0.3);
    }
  }
}

// Compares the grid with Newton's method for each pixel.
TEST(Frame, FindsPlacesWithinATenthOfAPixelOfTheInverse) {
  for (const LensCase& c : DistortingLenses()) {
    for (const int orientation : {1, 8}) {
      SCOPED_TRACE(std::string(NameOf(c.model)));
      const Frame frame(WarpedView(c.MakeLens(), 1, orientation));
      std::vector<Vector2f> row(frame.width());
      int num_shown = 0;
      for (int y = 0; y < frame.height(); ++y) {
        frame.PlacesOfRow(y, row);
        for (int x = 0; x < frame.width(); ++x) {
          const std::optional<Vector2d> exact = frame.ToView(Vector2d(x + 0.5, y + 0.5));
          const bool shown = !std::isnan(row[x].x());
          num_shown += shown ? 1 : 0;
          if (shown && exact) {
            EXPECT_LT((row[x].cast<double>() - *exact).norm(), 0.1) << x << " " << y;
          }
          // Visibility may differ only within a tenth of a pixel of the border.
          if (shown != exact.has_value()) {
            const Camera& camera = frame.camera();
            const Vector2d at = exact ? *exact : row[x].cast<double>();
            const double inside =
                std::min({at.x(), at.y(), camera.width - at.x(), camera.height - at.y()});
            EXPECT_LT(inside, 0.1) << x << " " << y;
          }
        }
      }
      EXPECT_GT(num_shown, frame.width() * frame.height() / 2);
    }
  }
}

}  // namespace
}  // namespace pepeseg
