#include "core/evaluate/mask_scores.h"

#include <gtest/gtest.h>

#include "core/evaluate/segmentation_metrics.h"

namespace pepeseg {
namespace {

TEST(PixelAccuracy, CountsRightPixelsInsideAndOutside) {
  const std::vector<uint8_t> truth = {1, 1, 1, 0, 0, 0, 0, 0}, mask = {1, 1, 0, 1, 0, 0, 0, 0};
  EXPECT_DOUBLE_EQ(PixelAccuracy(mask, truth), 6.0 / 8);
  // Without pixels 3 to 7: two of three are right.
  EXPECT_DOUBLE_EQ(PixelAccuracy(mask, truth, std::vector<uint8_t>{0, 0, 0, 1, 1, 1, 1, 1}),
                   2.0 / 3);
  EXPECT_EQ(PixelAccuracy(mask, truth, std::vector<uint8_t>(8, 1)), 1);
}

// A 3x3 square in a corner of 6x6 pixels, and the same square moved right by one. The boundary
// reaches one pixel deep: a square without its middle.
TEST(ScoreMask, MatchesHandCountedSquares) {
  std::vector<uint8_t> truth(36), mask(36);
  for (int y = 0; y < 3; ++y) {
    for (int x = 0; x < 3; ++x) truth[y * 6 + x] = mask[y * 6 + x + 1] = 1;
  }
  const MaskScores scores = ScoreMask(mask, truth, 6, 6);
  EXPECT_DOUBLE_EQ(scores.iou, 6.0 / 12);        // two columns of three are common
  EXPECT_DOUBLE_EQ(scores.accuracy, 30.0 / 36);  // a column of each is wrong
  // Boundaries of 8 pixels each. Common: (1, 0), (2, 0), (1, 2), (2, 2); the middle scanline has
  // (0, 1), (2, 1) of one and (1, 1), (3, 1) of the other.
  EXPECT_DOUBLE_EQ(scores.boundary_iou, 4.0 / 12);
}

TEST(MeanOf, IsTheMeanOfEachScore) {
  const std::vector<MaskScores> scores = {{0.5, 1, 0}, {1, 0.5, 0.25}};
  const MaskScores mean = MeanOf(scores);
  EXPECT_DOUBLE_EQ(mean.iou, 0.75);
  EXPECT_DOUBLE_EQ(mean.accuracy, 0.75);
  EXPECT_DOUBLE_EQ(mean.boundary_iou, 0.125);
  EXPECT_EQ(MeanOf({}).iou, 0);
}

TEST(IouByThreshold, LeavesOutPixelsBesideTheMask) {
  const std::vector<float> similarity = {0.9f, 0.8f, 0.9f, 0.1f};
  const std::vector<uint8_t> truth = {1, 1, 0, 0}, mask = {1, 1, 0, 1};
  const std::vector<double> thresholds = {0.5, 0.85};
  EXPECT_EQ(IouByThreshold(similarity, mask, truth, {}, thresholds), (std::vector<double>{1, 0.5}));
  EXPECT_EQ(IouByThreshold(similarity, {}, truth, {}, thresholds),
            (std::vector<double>{2.0 / 3, 1.0 / 3}));
  EXPECT_EQ(IouByThreshold(similarity, mask, truth, std::vector<uint8_t>{0, 1, 0, 0}, thresholds),
            (std::vector<double>{1, 1}));
}

}  // namespace
}  // namespace pepeseg
