#include "core/reconstruct/densifier.h"

#include <algorithm>
#include <cmath>

#include "tests/testing/status_testing.h"

namespace pepeseg {
namespace {

ReconstructOptions ShortRun() {
  ReconstructOptions options;
  options.num_steps = 1000;
  options.densify_from = 0.1;
  options.densify_until = 0.5;
  options.densify_every = 100;
  options.opacity_reset_every = 200;
  options.pixels_per_gaussian = 0;
  return options;
}

TEST(Densifier, IsDueBetweenTheTwoShares) {
  const auto backend = MakeCpuBackend(1);
  const Densifier densifier(*backend, ShortRun(), {});
  std::vector<int> due, resets;
  for (int step = 0; step < 1000; ++step) {
    if (densifier.Due(step)) due.push_back(step + 1);
    if (densifier.OpacityResetDue(step)) resets.push_back(step + 1);
  }
  EXPECT_EQ(due, (std::vector<int>{100, 200, 300, 400}));
  EXPECT_EQ(resets, (std::vector<int>{200, 400}));
}

TEST(Densifier, FadesOpacitiesInsteadOfResetsWithABudget) {
  const auto backend = MakeCpuBackend(1);
  ReconstructOptions options = ShortRun();
  options.pixels_per_gaussian = 20;
  const Densifier densifier(*backend, options, {});
  EXPECT_FALSE(densifier.OpacityResetDue(199));
  Gaussians initial = Gaussians::Zero(1, 0);
  initial.Plane(kRotationPlane)[0] = 1;
  initial.Plane(kOpacityPlane)[0] = 0;
  GaussianState state(*backend, initial);
  std::mt19937_64 random(1);
  ASSERT_OK(densifier.Apply(199, /*has_depth=*/false, state, random));
  const float opacity = 1 / (1 + std::exp(-state.Download().Plane(kOpacityPlane)[0]));
  EXPECT_NEAR(opacity, 0.5f * options.opacity_decay, 1e-6);
}

TEST(Densifier, GrowsItsBudgetToAShareOfThePixels) {
  const auto backend = MakeCpuBackend(1);
  ReconstructOptions options = ShortRun();
  const DensityScene scene = {.num_training_pixels = 100'000, .num_initial = 1000};
  EXPECT_EQ(Densifier(*backend, options, scene).BudgetAt(200), options.max_gaussians);
  options.pixels_per_gaussian = 20;
  const Densifier densifier(*backend, options, scene);
  EXPECT_EQ(densifier.BudgetAt(99), 1000);   // at densify_from
  EXPECT_EQ(densifier.BudgetAt(299), 3000);  // half way
  EXPECT_EQ(densifier.BudgetAt(499), 5000);
  options.max_gaussians = 3000;
  EXPECT_EQ(Densifier(*backend, options, scene).BudgetAt(499), 3000);
  options.pixels_per_gaussian = 1000;  // a budget below the present number keeps it
  EXPECT_EQ(Densifier(*backend, options, scene).BudgetAt(499), 1000);
}

Gaussians ThreeGaussians() {
  Gaussians out = Gaussians::Zero(3, 0);
  for (int i = 0; i < 3; ++i) {
    out.Plane(kMeanPlane)[i] = static_cast<float>(i);
    out.Plane(kRotationPlane)[i] = 1;
    for (int axis = 0; axis < 3; ++axis) out.Plane(kLogScalePlane + axis)[i] = std::log(1e-3f);
    out.Plane(kShPlane)[i] = static_cast<float>(10 + i);
  }
  out.Plane(kLogScalePlane)[1] = std::log(0.5f);  // large: splits
  out.Plane(kOpacityPlane)[2] = -8;               // faint: pruned
  return out;
}

TEST(Densifier, AppliesItsPlanToTheState) {
  const auto backend = MakeCpuBackend(1);
  GaussianState state(*backend, ThreeGaussians());
  for (int i = 0; i < 3; ++i) {
    state.stats().mean2d_grad_sum[i] = 1;
    state.stats().num_visible[i] = 1;
    state.num_steps()[i] = 7;
  }
  std::mt19937_64 random(1);
  ASSERT_OK(Densifier(*backend, ShortRun(), {}).Apply(99, /*has_depth=*/false, state, random));
  const Gaussians after = state.Download();
  ASSERT_EQ(after.count, 4);  // two of the first, two children of the second
  std::vector<float> colors(after.Plane(kShPlane).begin(), after.Plane(kShPlane).end());
  std::sort(colors.begin(), colors.end());
  EXPECT_EQ(colors, (std::vector<float>{10, 10, 11, 11}));
  int num_old = 0;
  for (int i = 0; i < 4; ++i) {
    num_old += state.num_steps()[i] == 7;
    if (after.Plane(kShPlane)[i] == 11) {
      EXPECT_FLOAT_EQ(after.Plane(kLogScalePlane)[i], std::log(0.5f / 1.6f));
      EXPECT_NE(after.Plane(kMeanPlane)[i], 1);
    }
  }
  EXPECT_EQ(num_old, 1);
}

// With a depth loss both Gaussians of a split are new, without one the parent stays.
TEST(Densifier, KeepsASplitParentUnlessADepthLossIsInEffect) {
  const auto backend = MakeCpuBackend(1);
  ReconstructOptions options = ShortRun();
  options.pixels_per_gaussian = 20;
  const Densifier densifier(*backend, options, {.num_training_pixels = 2000, .num_initial = 3});
  for (const bool has_depth : {false, true}) {
    GaussianState state(*backend, ThreeGaussians());
    state.stats().mean2d_grad_sum[1] = 1;
    state.stats().num_visible[1] = 1;
    std::mt19937_64 random(1);
    ASSERT_OK(densifier.Apply(499, has_depth, state, random));
    const Gaussians after = state.Download();
    ASSERT_EQ(after.count, 3);  // the first, and two in place of the second
    int num_parents = 0;
    for (const float log_scale : after.Plane(kLogScalePlane)) {
      num_parents += log_scale == std::log(0.5f) ? 1 : 0;
    }
    EXPECT_EQ(num_parents, has_depth ? 0 : 1);
  }
}

TEST(Densifier, PrunesBySizeOnceTheFirstResetIsOver) {
  const auto backend = MakeCpuBackend(1);
  ReconstructOptions options = ShortRun();
  options.prune_size = 0.1f;
  const Densifier densifier(*backend, options, {.radius = 2});
  EXPECT_EQ(densifier.MaxSizeAt(99), 0);
  EXPECT_EQ(densifier.MaxSizeAt(199), 0);
  EXPECT_FLOAT_EQ(densifier.MaxSizeAt(299), 0.2f);
  GaussianState state(*backend, ThreeGaussians());
  std::mt19937_64 random(1);
  ASSERT_OK(densifier.Apply(299, /*has_depth=*/false, state, random));
  EXPECT_EQ(state.count(), 1);  // the second is too large, the third too faint
  options.pixels_per_gaussian = 20;
  EXPECT_EQ(Densifier(*backend, options, {.radius = 2}).MaxSizeAt(299), 0);
}

TEST(Densifier, FailsWhenNoGaussianIsLeft) {
  const auto backend = MakeCpuBackend(1);
  Gaussians faint = ThreeGaussians();
  for (float& logit : faint.Plane(kOpacityPlane)) logit = -9;
  GaussianState state(*backend, faint);
  std::mt19937_64 random(1);
  EXPECT_STATUS(Densifier(*backend, ShortRun(), {}).Apply(99, /*has_depth=*/false, state, random),
                absl::StatusCode::kFailedPrecondition, "none of 3 Gaussians");
  EXPECT_EQ(state.count(), 3);
}

}  // namespace
}  // namespace pepeseg
