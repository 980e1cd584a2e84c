#include "core/features/preparation.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

#include "core/features/mask_completion.h"
#include "core/features/mask_scales.h"
#include "tests/core/features/perception_scene.h"
#include "tests/testing/status_testing.h"

namespace pepeseg {
namespace {

class PrepareFeaturesTest : public ::testing::Test {
 protected:
  PreparedFeatures Prepare(const FeatureOptions& options) {
    auto prepared = PrepareFeatures(*backend_, capture(), scene_.gaussians, options);
    EXPECT_OK(prepared);
    return *std::move(prepared);
  }

  // Removes the mask number `view % 3` of each view, if there is one: most views still have each
  // mask.
  void TakeMasks() {
    for (const int view : scene_.reprojection.views()) {
      const MaskSet masks = capture().views[view].masks;
      std::vector<BinaryMask> kept;
      for (int mask = 0; mask < masks.num_masks; ++mask) {
        if (mask != view % 3) kept.push_back(masks.Extract(mask));
      }
      capture().views[view].masks = BuildMaskSet(masks.width, masks.height, kept);
    }
  }

  static int NumCompleted(const PreparedFeatures& prepared) {
    return static_cast<int>(std::ranges::count_if(
        prepared.completed_masks, [](const MaskSet& masks) { return !masks.empty(); }));
  }

  Capture& capture() { return scene_.scene.capture; }

  testing::PerceptionScene scene_;
  std::unique_ptr<Backend> backend_ = MakeCpuBackend(2);
};

TEST_F(PrepareFeaturesTest, LeavesMasksThatAgreeAsTheyAre) {
  const PreparedFeatures prepared = Prepare({.share_scales = false});
  EXPECT_GE(prepared.mask_quality.value(), kCompleteBelow);
  EXPECT_EQ(NumCompleted(prepared), 0);
  for (const DrawableView& view : prepared.views) {
    EXPECT_EQ(view.masks, &capture().views[view.view].masks);
    EXPECT_EQ(view.mask_scales, scene_.mask_scales[view.view]);
  }
}

TEST_F(PrepareFeaturesTest, CompletesMasksThatSomeViewsLack) {
  TakeMasks();
  const PreparedFeatures prepared = Prepare({});
  EXPECT_LT(prepared.mask_quality.value(), kCompleteBelow);
  EXPECT_GT(NumCompleted(prepared), 0);
  for (const DrawableView& view : prepared.views) {
    ASSERT_EQ(view.mask_scales.size(), static_cast<size_t>(view.masks->num_masks));
    EXPECT_GE(view.masks->num_masks, capture().views[view.view].masks.num_masks);
  }
}

TEST_F(PrepareFeaturesTest, CompletesNoMasksWhenTurnedOff) {
  TakeMasks();
  const PreparedFeatures prepared = Prepare({.complete_masks = false});
  EXPECT_LT(prepared.mask_quality.value(), kCompleteBelow) << "measured all the same";
  EXPECT_EQ(NumCompleted(prepared), 0);
}

// The first mask of each view is of the same object, which some views show in part.
TEST_F(PrepareFeaturesTest, SharesScalesUnlessTurnedOff) {
  const auto largest_by_smallest = [this](const FeatureOptions& options) {
    const PreparedFeatures prepared = Prepare(options);
    std::vector<float> scales;
    for (const DrawableView& view : prepared.views) scales.push_back(view.mask_scales[0]);
    const auto [least, most] = std::ranges::minmax(scales);
    return most / least;
  };
  EXPECT_GT(largest_by_smallest({.share_scales = false}), 1.8f);
  EXPECT_LT(largest_by_smallest({}), 1.2f);
}

TEST_F(PrepareFeaturesTest, LeavesOutMasksUnderTheMinimumAgreement) {
  const int view = scene_.reprojection.views()[1];
  const MaskSet own = capture().views[view].masks;
  std::vector<BinaryMask> masks;
  for (int mask = 0; mask < own.num_masks; ++mask) masks.push_back(own.Extract(mask));
  BinaryMask stray = {std::vector<uint8_t>(own.pixel_cell.size())};
  for (int y = own.height / 2; y < own.height; ++y) {
    for (int x = own.width / 2 - 6; x < own.width / 2 + 6; ++x) {
      stray.pixels[static_cast<size_t>(y) * own.width + x] = 1;
    }
  }
  masks.push_back(stray);
  capture().views[view].masks = BuildMaskSet(own.width, own.height, masks);
  const auto last_scale = [&](double min_agreement) {
    const PreparedFeatures prepared = Prepare({.min_mask_agreement = min_agreement});
    for (const DrawableView& drawn : prepared.views) {
      if (drawn.view == view) return drawn.mask_scales[masks.size() - 1];
    }
    return -1.0f;
  };
  EXPECT_GT(last_scale(0), kNoScale);
  EXPECT_EQ(last_scale(0.5), kNoScale);
}

Gaussians RandomMeans(int64_t count, bool on_grid) {
  Gaussians gaussians = Gaussians::Zero(count, 0);
  std::mt19937_64 engine(7);
  for (int axis = 0; axis < 3; ++axis) {
    for (float& x : gaussians.Plane(kMeanPlane + axis)) {
      x = on_grid ? static_cast<float>(engine() % 4)
                  : static_cast<float>(engine() % 10'000) * 1e-3f;
    }
  }
  return gaussians;
}

double Distance(const Gaussians& gaussians, int64_t a, int64_t b) {
  double squares = 0;
  for (int axis = 0; axis < 3; ++axis) {
    const auto plane = gaussians.Plane(kMeanPlane + axis);
    squares += std::pow(double{plane[a]} - plane[b], 2);
  }
  return std::sqrt(squares);
}

// On the grid many means are equal, and many distances.
TEST(NearestNeighbors, ReturnsTheNearestWithTheGaussianItselfFirst) {
  for (const bool on_grid : {false, true}) {
    const Gaussians gaussians = RandomMeans(3000, on_grid);
    const std::vector<int32_t> neighbors = NearestNeighbors(gaussians, 16);
    ASSERT_EQ(neighbors.size(), 3000u * 16);
    for (int64_t i = 0; i < 3000; i += 37) {
      std::vector<double> all, got;
      for (int64_t j = 0; j < 3000; ++j) all.push_back(Distance(gaussians, i, j));
      std::partial_sort(all.begin(), all.begin() + 16, all.end());
      std::vector<int32_t> own(neighbors.begin() + i * 16, neighbors.begin() + (i + 1) * 16);
      EXPECT_EQ(own[0], i);
      for (const int32_t j : own) got.push_back(Distance(gaussians, i, j));
      std::sort(got.begin(), got.end());
      for (int k = 0; k < 16; ++k) ASSERT_NEAR(got[k], all[k], 1e-6);
      std::sort(own.begin(), own.end());
      EXPECT_EQ(std::unique(own.begin(), own.end()), own.end());
    }
  }
}

TEST(NearestNeighbors, RepeatsTheGaussianItselfIfThereAreTooFew) {
  const std::vector<int32_t> neighbors = NearestNeighbors(RandomMeans(3, false), 5);
  for (int32_t i = 0; i < 3; ++i) {
    const auto own = neighbors.begin() + i * 5;
    EXPECT_EQ(*own, i);
    EXPECT_EQ(std::count(own, own + 5, i), 3);
  }
  EXPECT_TRUE(NearestNeighbors(Gaussians::Zero(0, 0), 5).empty());
}

TEST(NearestNeighbors, IsDeterministic) {
  const Gaussians gaussians = RandomMeans(5000, true);
  EXPECT_EQ(NearestNeighbors(gaussians, 8), NearestNeighbors(gaussians, 8));
}

}  // namespace
}  // namespace pepeseg
