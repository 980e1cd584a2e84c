#include "core/features/mask_agreement.h"

#include <gtest/gtest.h>

#include "core/features/mask_scales.h"
#include "tests/core/features/wall_capture.h"

namespace pepeseg {
namespace {

using ::pepeseg::testing::WallCapture;
using ::pepeseg::testing::WallPatch;

constexpr WallPatch kLeftHalf = {-0.8, -0.5, -0.2, 0.5}, kRightHalf = {0.2, -0.5, 0.8, 0.5},
                    kBoth = {-0.8, -0.5, 0.8, 0.5};

TEST(MaskAgreement, IsOneWhereViewsAgree) {
  const WallCapture wall({{kLeftHalf, kRightHalf},
                          {kLeftHalf, kRightHalf},
                          {kLeftHalf, kRightHalf},
                          {kLeftHalf, kRightHalf}});
  const MaskAgreements agreements = MeasureMaskAgreement(wall.capture, wall.reprojection);
  ASSERT_EQ(agreements.size(), 4u);
  for (const auto& of_view : agreements) {
    ASSERT_EQ(of_view.size(), 2u);
    for (const MaskAgreement& agreement : of_view) {
      EXPECT_EQ(agreement.num_seen, 3);
      EXPECT_EQ(agreement.num_same, 3);
      EXPECT_NEAR(agreement.iou, 1, 1e-6);
      EXPECT_FALSE(StandsAlone(agreement, 0.99));
    }
  }
  EXPECT_NEAR(MaskQuality(wall.capture, agreements).value(), 1, 1e-6);
}

TEST(MaskAgreement, IsLowForAMaskThatStandsAlone) {
  const WallPatch alone = {-0.4, -0.4, 0.4, 0.4};
  const WallCapture wall({{kLeftHalf, kRightHalf, alone},
                          {kLeftHalf, kRightHalf},
                          {kLeftHalf, kRightHalf},
                          {kLeftHalf, kRightHalf}});
  const MaskAgreements agreements = MeasureMaskAgreement(wall.capture, wall.reprojection);
  const MaskAgreement& of_alone = agreements[0][2];
  EXPECT_EQ(of_alone.num_seen, 3);
  EXPECT_EQ(of_alone.num_same, 0);
  // The best IoU is with one half: 0.2 x 0.8 are shared of 0.6 x 1 and 0.8 x 0.8.
  EXPECT_NEAR(of_alone.iou, 0.16 / (0.6 + 0.64 - 0.16), 0.05);
  EXPECT_TRUE(StandsAlone(of_alone, 0.3));
  EXPECT_FALSE(StandsAlone(of_alone, 0));
  EXPECT_FALSE(StandsAlone(agreements[0][0], 0.3));
  EXPECT_NEAR(agreements[0][0].iou, 1, 1e-6);
}

TEST(MaskAgreement, CountsAViewThatLacksTheMaskAsDisagreement) {
  const WallCapture wall(
      {{kLeftHalf, kRightHalf}, {kLeftHalf, kRightHalf}, {kLeftHalf, kRightHalf}, {kRightHalf}});
  const MaskAgreements agreements = MeasureMaskAgreement(wall.capture, wall.reprojection);
  EXPECT_EQ(agreements[0][0].num_seen, 3);
  EXPECT_EQ(agreements[0][0].num_same, 2);
  EXPECT_NEAR(agreements[0][0].iou, 2.0 / 3, 1e-6);
  EXPECT_NEAR(agreements[3][0].iou, 1, 1e-6);
}

// A mask that another view has as two masks may be a whole of two parts: neither is wrong.
TEST(MaskAgreement, IsTheIouOfAWholeWithItsLargestPart) {
  const WallCapture wall({{kBoth}, {kLeftHalf, kRightHalf}});
  const MaskAgreements agreements = MeasureMaskAgreement(wall.capture, wall.reprojection);
  EXPECT_NEAR(agreements[0][0].iou, 0.6 / 1.6, 0.03);
  EXPECT_NEAR(agreements[1][0].iou, 0.6 / 1.6, 0.03);
  EXPECT_FALSE(StandsAlone(agreements[0][0], 1)) << "one view is too few to judge";
}

TEST(MaskAgreement, DoesNotJudgeWhatOtherViewsDoNotSee) {
  WallCapture wall({{kLeftHalf, kRightHalf}, {kRightHalf}, {kRightHalf}, {kRightHalf}});
  for (size_t view = 1; view < 4; ++view) {
    std::vector<uint8_t>& ignore = wall.capture.views[view].ignore;
    for (const uint8_t hidden : wall.MaskOf(static_cast<int>(view), kLeftHalf).pixels) {
      ignore.push_back(hidden);
    }
  }
  const MaskAgreements agreements = MeasureMaskAgreement(wall.capture, wall.reprojection);
  EXPECT_EQ(agreements[0][0].num_seen, 0);
  EXPECT_FALSE(StandsAlone(agreements[0][0], 1));
  EXPECT_NEAR(MaskQuality(wall.capture, agreements).value(), 1, 1e-6) << "left out of the mean";
}

// Four views have two things; one of them also has a mask of its own.
class ShareScalesTest : public ::testing::Test {
 protected:
  using Scales = std::vector<std::vector<float>>;  // by view and mask

  Scales Share(Scales scales) const {
    ShareScales(MeasureMaskAgreement(wall_.capture, wall_.reprojection), scales);
    return scales;
  }
  WallCapture wall_{{{kLeftHalf, kRightHalf, {-0.4, -0.4, 0.4, 0.4}},
                     {kLeftHalf, kRightHalf},
                     {kLeftHalf, kRightHalf},
                     {kLeftHalf, kRightHalf}}};
};

TEST_F(ShareScalesTest, TakesTheMedianOfTheSameThing) {
  EXPECT_EQ(Share({{3, 7, 5}, {1, 8}, {2, 6}, {9, 9}}),
            (Scales{{3, 8, 5}, {3, 8}, {3, 8}, {3, 8}}));
}

TEST_F(ShareScalesTest, LeavesOutMasksWithoutAScale) {
  EXPECT_EQ(Share({{3, 7, 5}, {kNoScale, 8}, {4, 6}, {5, kNoScale}}),
            (Scales{{4, 7, 5}, {kNoScale, 7}, {4, 7}, {4, kNoScale}}));
}

TEST(MaskAgreement, HasNoQualityWithOneView) {
  const WallCapture wall({{kLeftHalf, kRightHalf}});
  const MaskAgreements agreements = MeasureMaskAgreement(wall.capture, wall.reprojection);
  ASSERT_EQ(agreements[0].size(), 2u);
  EXPECT_EQ(agreements[0][0].num_seen, 0);
  EXPECT_FALSE(MaskQuality(wall.capture, agreements).has_value());
}

TEST(MaskAgreement, HasNoQualityWithoutMasks) {
  const WallCapture wall({{}, {}, {}});
  const MaskAgreements agreements = MeasureMaskAgreement(wall.capture, wall.reprojection);
  EXPECT_TRUE(agreements[0].empty());
  EXPECT_FALSE(MaskQuality(wall.capture, agreements).has_value());
}

}  // namespace
}  // namespace pepeseg
