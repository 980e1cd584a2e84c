#include "core/reconstruct/depth_term.h"

#include <gtest/gtest.h>

#include "tests/testing/synthetic_capture.h"

namespace pepeseg {
namespace {

const Capture& WithPriors() {
  static const Capture capture =
      testing::MakeSyntheticScene(
          {.width = 48, .height = 36, .depth = DepthPrior::Kind::kDisparity})
          .capture;
  return capture;
}

TEST(DepthWeight, FollowsTheKindOfCaptureByDefault) {
  ReconstructOptions options;
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
