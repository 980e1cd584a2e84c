#include "core/query/prompt.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <string>

#include "core/query/frame.h"
#include "tests/core/query/warped_view.h"
#include "tests/testing/lens_cases.h"
#include "tests/testing/status_testing.h"

namespace pepeseg {
namespace {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
const PromptImage kImage = {"view \"a\"", 64, 48};

// Expects an error with a fault in this part.
void ExpectFault(const absl::Status& status, const std::string& part, const std::string& message) {
  EXPECT_STATUS(status, absl::StatusCode::kInvalidArgument, message);
  const std::optional<PromptFault> fault = FaultOf(status);
  ASSERT_TRUE(fault.has_value()) << status;
  EXPECT_EQ(fault->part, part);
}

TEST(CheckShape, NeedsAPositiveFinitePointInTheImage) {
  PointsPrompt points;
  ExpectFault(CheckShape(kImage, points), "points", "0 points, allowed are 1..64");
  points.push_back({2, 3, false});
  ExpectFault(CheckShape(kImage, points), "points", "no positive point");
  points.push_back({2.5, 3, true});
  EXPECT_OK(CheckShape(kImage, points));
  points[0].y = kNan;
  ExpectFault(CheckShape(kImage, points), "points[0]", "is not finite");
  points[0].y = 48;
  ExpectFault(CheckShape(kImage, points), "points[0]", "point 2,48 is outside view \"a\" (64x48)");
  points.assign(kMaxPromptPoints, {1, 1, true});
  EXPECT_OK(CheckShape(kImage, points));
  points.push_back({1, 1, true});
  ExpectFault(CheckShape(kImage, points), "points", "65 points");
  EXPECT_OK(CheckPoints(kImage, points));  // an evaluation may click more often
}

TEST(CheckShape, NeedsPositivePointsForAMean) {
  EXPECT_OK(CheckShape(kImage, PointMean{{{1, 2, true}, {3, 4, true}}}));
  ExpectFault(CheckShape(kImage, PointMean{{{1, 2, true}, {3, 4, false}}}), "points[1].negative",
              "a mean has positive points only");
  ExpectFault(CheckShape(kImage, PointMean{}), "points", "0 points");
}

TEST(CheckShown, TakesAPreviousMaskForPoints) {
  const BinaryMask mask = {std::vector<uint8_t>(64 * 48, 1)};
  const PointsPrompt negative = {{2, 3, false}};
  EXPECT_OK(CheckShown(kImage, {{}, negative, mask}));
  ExpectFault(CheckShown(kImage, {{}, negative}), "points", "no positive point");
  ExpectFault(CheckShown(kImage, {{}, PointsPrompt{}, mask}), "points", "0 points");
  ExpectFault(CheckShown(kImage, {{}, negative, BinaryMask{{1}}}), "", "the mask has 1 pixels");
  ExpectFault(CheckShown(kImage, {{}, negative, BinaryMask{std::vector<uint8_t>(64 * 48)}}), "",
              "no pixel is in the mask");
  ExpectFault(CheckShown(kImage, {{}, BoxPrompt{1, 1, 5, 5}, mask}), "previous_mask",
              "is for points");
}

TEST(CheckShape, NeedsAPositiveStrokeOfTheImage) {
  const BinaryMask stroke = {std::vector<uint8_t>(64 * 48, 1)};
  EXPECT_OK(CheckShape(kImage, Scribbles{stroke, {}}));
  EXPECT_OK(CheckShape(kImage, Scribbles{stroke, stroke}));
  ExpectFault(CheckShape(kImage, Scribbles{{}, stroke}), "", "no positive stroke");
  ExpectFault(CheckShape(kImage, Scribbles{stroke, {{1}}}), "", "the mask has 1 pixels");
}

TEST(CheckStrokes, BoundsWidthVerticesAndArea) {
  const auto check = [](const Stroke& stroke) { return CheckStrokes(kImage, {&stroke, 1}); };
  const Eigen::Vector2d from(1, 2), to(60, 40);
  EXPECT_OK(check({{from}, false, 0}));
  EXPECT_OK(check({{from, to}, true, kMaxStrokeWidth}));
  ExpectFault(check({{from, to}, true, kMaxStrokeWidth + 1}), "strokes[0].width",
              "not in [0, 256]");
  ExpectFault(check({{from, to}, true, kNan}), "strokes[0].width", "not in [0, 256]");
  ExpectFault(check({{}, true, 1}), "strokes[0].path", "has no vertex");
  ExpectFault(check({{from, {64, 40}}, true, 1}), "strokes[0].path[1]",
              "point 64,40 is outside view \"a\" (64x48)");
  ExpectFault(check({std::vector(kMaxVertices + 1, from), true, 1}), "strokes",
              "4097 vertices, allowed are 4096");
  std::vector<Eigen::Vector2d> long_path;
  for (size_t i = 0; i < kMaxVertices; ++i) long_path.push_back(i % 2 == 0 ? from : to);
  ExpectFault(check({long_path, true, kMaxStrokeWidth}), "strokes", "allowed are 16000000");
}

TEST(CheckShape, NeedsABoxThatOverlapsTheImage) {
  EXPECT_OK(CheckShape(kImage, BoxPrompt{-5, -5, 6, 6}));
  ExpectFault(CheckShape(kImage, BoxPrompt{-5, -5, 5, 6}), "", "is outside view \"a\"");
  ExpectFault(CheckShape(kImage, BoxPrompt{kNan, 1, 5, 6}), "", "is not finite, or is empty");
  ExpectFault(CheckShape(kImage, BoxPrompt{1, 1, 5, -1}), "", "is not finite, or is empty");
}

TEST(CheckShape, NeedsAMaskOfTheImageWithAPixel) {
  BinaryMask mask = {std::vector<uint8_t>(64 * 48)};
  ExpectFault(CheckShape(kImage, mask), "", "no pixel is in the mask");
  mask.pixels[7] = 1;
  EXPECT_OK(CheckShape(kImage, mask));
  mask.pixels.pop_back();
  ExpectFault(CheckShape(kImage, mask), "", "must have the 3072 of view \"a\"");
}

TEST(CheckView, LimitsAFreeCameraMoreThanAView) {
  ModelView view;
  view.camera = {4001, 4000, 50, 50, 32, 24};
  ExpectFault(CheckView(view), "camera", "16000000 in all");
  view.name = "a";
  EXPECT_OK(CheckView(view));
  view.camera.width = 16'001;
  ExpectFault(CheckView(view), "camera", "64000000 in all");
  view.camera.width = 64;
  view.camera.fy = 0;
  ExpectFault(CheckView(view), "camera.fy", "camera.fy is 0");
  view.camera.fy = 50;
  view.cam_from_world.rotation.w() = 1.0009;
  EXPECT_OK(CheckView(view));
  view.cam_from_world.rotation.w() = 1.0011;
  ExpectFault(CheckView(view), "cam_from_world.rotation", "norm 1.0011");
  view.cam_from_world.rotation.w() = 1;
  view.cam_from_world.translation.y() = kNan;
  ExpectFault(CheckView(view), "cam_from_world.translation.y", "is not finite");
}

TEST(CheckGranularity, NamesThePartOutOfRange) {
  EXPECT_OK(CheckGranularity({}));
  EXPECT_OK(CheckGranularity({0, -1}));
  ExpectFault(CheckGranularity({.scale = 1.5}), "scale_quantile", "scale_quantile is 1.5");
  ExpectFault(CheckGranularity({.threshold = kNan}), "threshold", "threshold is nan");
}

TEST(FramePrompt, IsTakenToTheViewOrRefused) {
  ModelView view = testing::WarpedView(testing::DistortingLenses()[0].MakeLens(), 0.5);
  view.name = "a";
  const Frame frame(view);
  ASSERT_OK_AND_ASSIGN(const Prompt taken,
                       frame.ToView(Prompt{view, PointsPrompt{{80, 60, true}}}));
  const PointPrompt point = std::get<PointsPrompt>(taken.what)[0];
  EXPECT_NEAR((frame.FromView(Eigen::Vector2d(point.x, point.y)) - Eigen::Vector2d(80, 60)).norm(),
              0, 1e-5);
  const absl::Status corner = frame.ToView(Prompt{view, PointsPrompt{{0.5, 0.5, true}}}).status();
  ExpectFault(corner, "points[0]", "point 0.5,0.5 is in a part of photograph");
  EXPECT_TRUE(IsNothingThere(corner));
  EXPECT_TRUE(IsNothingThere(frame.ToView(Prompt{view, BoxPrompt{0, 0, 1, 1}}).status()));
  BinaryMask mask = {std::vector<uint8_t>(static_cast<size_t>(frame.width()) * frame.height())};
  mask.pixels[0] = 1;
  ExpectFault(frame.ToView(Prompt{view, mask}).status(), "", "no pixel of the mask");
  const PointsPrompt middle = {{80, 60, true}};
  ExpectFault(frame.ToView(Prompt{view, middle, mask}).status(), "", "no pixel of the mask");
  mask.pixels.assign(mask.pixels.size(), 1);
  ASSERT_OK_AND_ASSIGN(const Prompt corrected, frame.ToView(Prompt{view, middle, mask}));
  EXPECT_EQ(std::ssize(corrected.previous->pixels), view.camera.width * view.camera.height);
  // In pixels of the view, all stays as it is.
  const Frame same(view, FrameKind::kView);
  ASSERT_OK_AND_ASSIGN(const Prompt kept,
                       same.ToView(Prompt{view, PointsPrompt{{0.5, 0.25, true}}}));
  EXPECT_EQ(std::get<PointsPrompt>(kept.what)[0].y, 0.25);
}

}  // namespace
}  // namespace pepeseg
