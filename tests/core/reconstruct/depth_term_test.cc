#include "core/reconstruct/depth_term.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "tests/testing/synthetic_capture.h"

namespace pepeseg {
namespace {

// Returns cameras turned about the vertical axis, from -half to half degrees, on an arc about a
// point at the distance `radius` in front of them. 0: all at one place.
Capture Arc(double half, int num_views, double radius) {
  Capture capture;
  for (int i = 0; i < num_views; ++i) {
    const double share = num_views > 1 ? double(i) / (num_views - 1) : 0.5;
    const double angle = (2 * share - 1) * half * std::numbers::pi / 180;
    View view;
    view.cam_from_world.rotation =
        Eigen::Quaterniond(Eigen::AngleAxisd(angle, Eigen::Vector3d::UnitY()));
    view.cam_from_world.translation = {0, 0, radius};
    capture.views.push_back(view);
  }
  return capture;
}

TEST(ViewingSpread, IsTheRootMeanSquareAngle) {
  EXPECT_NEAR(ViewingSpread(Arc(45, 1001, 3)), 45 / std::sqrt(3), 0.05);
  EXPECT_NEAR(ViewingSpread(Arc(10, 2, 3)), 10, 1e-9);
  EXPECT_NEAR(ViewingSpread(Arc(10, 1, 3)), 0, 1e-6);
  EXPECT_EQ(ViewingSpread({}), 0);
}

TEST(ViewingSpread, Is180DegreesWhenDirectionsCancelOut) {
  EXPECT_EQ(ViewingSpread(Arc(90, 2, 0)), 180);
}

TEST(ViewingSpread, IgnoresHeldOutViews) {
  Capture capture = Arc(60, 3, 3);
  capture.views.front().held_out = capture.views.back().held_out = true;
  EXPECT_NEAR(ViewingSpread(capture), 0, 1e-6);
}

TEST(FindCaptureKind, DistinguishesOrbitsFromForwardFacingCaptures) {
  EXPECT_EQ(FindCaptureKind(Arc(180, 36, 3)), CaptureKind::kOrbit);
  EXPECT_EQ(FindCaptureKind(Arc(45, 12, 3)), CaptureKind::kOrbit);
  EXPECT_EQ(FindCaptureKind(Arc(30, 12, 3)), CaptureKind::kForwardFacing);
  EXPECT_EQ(FindCaptureKind(Arc(10, 20, 3)), CaptureKind::kForwardFacing);
  EXPECT_EQ(FindCaptureKind(Arc(0, 20, 3)), CaptureKind::kForwardFacing);
}

TEST(FindCaptureKind, DoesNotDependOnRollOrTheWorldsAxes) {
  for (const double half : {20.0, 60.0}) {
    Capture capture = Arc(half, 9, 3);
    const CaptureKind kind = FindCaptureKind(capture);
    const Eigen::Quaterniond world(0.2, 0.5, -0.3, 0.7);
    for (size_t i = 0; i < capture.views.size(); ++i) {
      const Eigen::AngleAxisd roll(0.4 * static_cast<double>(i), Eigen::Vector3d::UnitZ());
      Eigen::Quaterniond& rotation = capture.views[i].cam_from_world.rotation;
      rotation = roll * rotation * world.normalized();
    }
    EXPECT_EQ(FindCaptureKind(capture), kind);
  }
}

const Capture& WithPriors() {
  static const Capture capture =
      testing::MakeSyntheticScene(
          {.width = 48, .height = 36, .depth = DepthPrior::Kind::kDisparity})
          .capture;
  return capture;
}

TEST(DepthWeight, FollowsTheKindOfCapture) {
  ReconstructOptions options;
  EXPECT_EQ(WithDepthWeight(options, WithPriors()).depth_weight, 0) << "the default";
  options.depth_weight = -1;
  EXPECT_FLOAT_EQ(WithDepthWeight(options, WithPriors()).depth_weight, 0.05f);
  options.capture_kind = CaptureKind::kForwardFacing;
  EXPECT_FLOAT_EQ(WithDepthWeight(options, WithPriors()).depth_weight, 0.1f);
  options.depth_weight = 0.3f;
  EXPECT_FLOAT_EQ(WithDepthWeight(options, WithPriors()).depth_weight, 0.3f);
}

TEST(DepthWeight, IsZeroWithoutAPriorInATrainingView) {
  Capture capture = WithPriors();
  for (View& view : capture.views) {
    if (!view.held_out) view.depth.values.clear();
  }
  ReconstructOptions options;
  options.depth_weight = 0.3f;
  EXPECT_EQ(WithDepthWeight(options, capture).depth_weight, 0);
}

class DepthTermTest : public ::testing::Test {
 protected:
  DepthTermTest()
      : backend_(MakeCpuBackend(1)),
        views_(*backend_, WithPriors(), {.coarse = true, .with_depth = true}) {
    options_.depth_weight = 0.05f;
  }
  std::unique_ptr<Backend> backend_;
  TrainingViews views_;
  ReconstructOptions options_;
  std::mt19937_64 random_;
};

TEST_F(DepthTermTest, HasNoImagesWithoutAWeightOrAPrior) {
  DepthTerm term(*backend_, options_, views_.max_pixels());
  EXPECT_TRUE(term.allocated());
  const TrainingView& view = views_.At(0, 1);
  EXPECT_EQ(term.PlanFor(view, 0, random_).weight, 0);
  EXPECT_EQ(term.PlanFor(TrainingView(), 0.05f, random_).weight, 0);
  EXPECT_TRUE(term.ImagesFor(view, {}).alpha.empty());
  EXPECT_TRUE(term.ImagesFor(view, {}).depth_grad.empty());
  options_.depth_weight = 0;
  const size_t bytes = backend_->bytes_in_use();
  const DepthTerm none(*backend_, options_, views_.max_pixels());
  EXPECT_TRUE(none.allocated());
  EXPECT_EQ(backend_->bytes_in_use(), bytes);
}

TEST_F(DepthTermTest, HasImagesOfTheViewsSize) {
  DepthTerm term(*backend_, options_, views_.max_pixels());
  const TrainingView& half = views_.At(0, 2);
  const DepthPlan plan = term.PlanFor(half, 0.05f, random_);
  EXPECT_FLOAT_EQ(plan.weight, 0.05f);
  const DepthImages images = term.ImagesFor(half, plan);
  EXPECT_TRUE(images.inverse_depth);
  EXPECT_EQ(images.alpha.size, 24 * 18);
  EXPECT_EQ(images.depth_grad.size, 24 * 18);
}

// The rendered depth is a fit of the prior, and alpha is 0.
TEST_F(DepthTermTest, ComparesThePlainBlendAtAllPixels) {
  for (const bool over_alpha : {true, false}) {
    options_.depth_over_alpha = over_alpha;
    DepthTerm term(*backend_, options_, views_.max_pixels());
    ASSERT_TRUE(term.allocated());
    const TrainingView& view = views_.At(0, 1);
    const DepthPlan plan = term.PlanFor(view, 0.05f, random_);
    const DepthImages images = term.ImagesFor(view, plan);
    std::vector<float> prior(static_cast<size_t>(images.depth.size));
    view.prior.Download(std::span<float>(prior));
    const auto num_known = std::ranges::count_if(prior, [](float d) { return !std::isnan(d); });
    for (size_t i = 0; i < prior.size(); ++i) images.depth[i] = 2 * prior[i] + 1;
    std::fill_n(images.alpha.data, images.alpha.size, 0.0f);
    std::vector<double> sums(kNumDepthLossSums);
    Buffer<double> on_device(*backend_, kNumDepthLossSums);
    term.Compare(view, plan, on_device.span());
    on_device.Download(std::span<double>(sums));
    EXPECT_EQ(sums[kSumDepthPixels], over_alpha ? 0 : static_cast<double>(num_known));
    if (!over_alpha) {
      EXPECT_NEAR(sums[kDepthScale], 0.5, 1e-3);
    }
    for (int64_t i = 0; i < images.alpha_grad.size; ++i) ASSERT_EQ(images.alpha_grad[i], 0);
  }
}

TEST_F(DepthTermTest, DrawsDifferentPatchesInsideTheView) {
  options_.depth_local_form = DepthLocalForm::kPatch;
  const DepthTerm term(*backend_, options_, views_.max_pixels());
  int widest = 0, narrowest = 48;
  for (int i = 0; i < 500; ++i) {
    const PixelBox patch = term.PlanFor(views_.At(0, 1), 0.05f, random_).patch;
    ASSERT_GE(patch.x, 0);
    ASSERT_GE(patch.y, 0);
    ASSERT_LE(patch.x + patch.width, 48);
    ASSERT_LE(patch.y + patch.height, 36);
    widest = std::max(widest, patch.width);
    narrowest = std::min(narrowest, patch.width);
  }
  EXPECT_EQ(narrowest, 3);
  EXPECT_EQ(widest, 16);
}

}  // namespace
}  // namespace pepeseg
