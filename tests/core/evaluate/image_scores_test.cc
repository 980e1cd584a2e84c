#include "core/evaluate/image_scores.h"

#include <cmath>
#include <vector>

#include "tests/testing/status_testing.h"

namespace pepeseg {
namespace {

// Views without a Gaussian in sight render black: the photograph alone decides the scores.
Capture TwoHeldOutViews(uint8_t first_value, uint8_t second_value) {
  Capture capture;
  for (const uint8_t value : {first_value, uint8_t{77}, second_value}) {
    View view;
    view.name = "view" + std::to_string(capture.views.size()) + ".png";
    view.camera = {20, 16, 18, 18, 10, 8};
    view.cam_from_world.translation.x() = static_cast<double>(capture.views.size());
    view.held_out = capture.views.size() != 1;
    view.photo = {20, 16, 3, std::vector<uint8_t>(20 * 16 * 3, value)};
    capture.views.push_back(view);
  }
  return capture;
}

Gaussians BehindTheCameras() {
  Gaussians gaussians = Gaussians::Zero(1, 0);
  gaussians.Plane(kMeanPlane + 2)[0] = -5;
  gaussians.Plane(kRotationPlane)[0] = 1;
  return gaussians;
}

TEST(ScoreHeldOut, MatchesHandComputedPsnrOfAFlatImage) {
  const auto backend = MakeCpuBackend(1);
  // Black against 51 / 255 = 0.2: MSE 0.04. Black against black: the cap of 100 dB, SSIM 1.
  ASSERT_OK_AND_ASSIGN(const auto scores,
                       ScoreHeldOut(*backend, TwoHeldOutViews(51, 0), BehindTheCameras()));
  ASSERT_EQ(scores.size(), 2u);
  EXPECT_EQ(scores[0].view, "view0.png");
  EXPECT_EQ(scores[1].view, "view2.png");
  EXPECT_NEAR(scores[0].scores.psnr, -10 * std::log10(0.04), 1e-4);
  EXPECT_NEAR(scores[1].scores.psnr, 100, 1e-9);
  EXPECT_NEAR(scores[1].scores.ssim, 1, 1e-6);
}

TEST(ScoreHeldOut, GivesTheDistanceThePhotographsIgnoredPixels) {
  Capture capture = TwoHeldOutViews(51, 102);
  capture.views[0].ignore.assign(20 * 16, 0);
  capture.views[0].ignore[7] = 1;
  const auto backend = MakeCpuBackend(1);
  const auto distance = [](const Image& photo,
                           std::span<const float> rendering) -> std::optional<double> {
    if (photo.pixels[0] == 102) return std::nullopt;
    EXPECT_EQ(rendering.size(), 20u * 16 * 3);
    for (size_t i = 0; i < rendering.size(); ++i) {
      EXPECT_EQ(rendering[i], i / 3 == 7 ? 0.2f : 0.0f) << i;
    }
    return 0.25;
  };
  ASSERT_OK_AND_ASSIGN(const auto scores,
                       ScoreHeldOut(*backend, capture, BehindTheCameras(), distance));
  EXPECT_EQ(scores[0].scores.lpips, 0.25);
  EXPECT_EQ(scores[1].scores.lpips, std::nullopt);
  EXPECT_EQ(Mean(scores).lpips, 0.25);
  ASSERT_OK_AND_ASSIGN(const auto without, ScoreHeldOut(*backend, capture, BehindTheCameras()));
  EXPECT_EQ(Mean(without).lpips, std::nullopt);
}

TEST(ScoreHeldOut, MatchesHandComputedSsimOfOnePixel) {
  Capture capture = TwoHeldOutViews(51, 51);
  // One pixel counts. Ignored pixels show the photograph in both images, so the window around it
  // holds y = 0.2 throughout, and x = 0.2 except for a 0 at its centre.
  View& view = capture.views[0];
  view.ignore.assign(20 * 16, 1);
  view.ignore[8 * 20 + 10] = 0;
  const auto backend = MakeCpuBackend(1);
  ASSERT_OK_AND_ASSIGN(const auto scores, ScoreHeldOut(*backend, capture, BehindTheCameras()));
  double sum = 0;
  for (int k = -5; k <= 5; ++k) sum += std::exp(-k * k / (2 * 1.5 * 1.5));
  const double w = 1 / (sum * sum);  // the window's weight at its centre
  const double c1 = 1e-4, c2 = 9e-4, mean_y = 0.2, mean_x = 0.2 * (1 - w);
  const double variance_x = 0.04 * (1 - w) - mean_x * mean_x;  // y's and the covariance are 0
  const double expected = (2 * mean_x * mean_y + c1) / (mean_x * mean_x + mean_y * mean_y + c1) *
                          c2 / (variance_x + c2);
  EXPECT_NEAR(scores[0].scores.ssim, expected, 1e-5);
}

TEST(ScoreHeldOut, LeavesOutIgnoredPixels) {
  Capture capture = TwoHeldOutViews(51, 51);
  View& view = capture.views[0];
  view.ignore.assign(20 * 16, 0);
  for (int i = 0; i < 20 * 8; ++i) {  // the upper half is white, and ignored
    view.ignore[i] = 255;
    for (int c = 0; c < 3; ++c) view.photo.pixels[3 * i + c] = 255;
  }
  const auto backend = MakeCpuBackend(1);
  ASSERT_OK_AND_ASSIGN(const auto scores, ScoreHeldOut(*backend, capture, BehindTheCameras()));
  EXPECT_NEAR(scores[0].scores.psnr, -10 * std::log10(0.04), 1e-4);
}

TEST(ScoreHeldOut, NamesTheViewThatCannotBeScored) {
  const auto backend = MakeCpuBackend(1);
  Capture capture = TwoHeldOutViews(51, 51);
  capture.views[2].photo.pixels.pop_back();
  EXPECT_STATUS(ScoreHeldOut(*backend, capture, BehindTheCameras()),
                absl::StatusCode::kFailedPrecondition, "view2.png");
  capture = TwoHeldOutViews(51, 51);
  capture.views[0].ignore.assign(20 * 16, 1);
  EXPECT_STATUS(ScoreHeldOut(*backend, capture, BehindTheCameras()),
                absl::StatusCode::kFailedPrecondition, "leaves no pixel");
}

TEST(Mean, AveragesEachScore) {
  const std::vector<ViewScores> scores = {{"a", {20, 0.5}}, {"b", {30, 0.9}}};
  EXPECT_DOUBLE_EQ(Mean(scores).psnr, 25);
  EXPECT_DOUBLE_EQ(Mean(scores).ssim, 0.7);
  EXPECT_DOUBLE_EQ(Mean({}).psnr, 0);
}

}  // namespace
}  // namespace pepeseg
