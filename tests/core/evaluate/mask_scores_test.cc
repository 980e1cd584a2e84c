#include "core/evaluate/mask_scores.h"

#include <gtest/gtest.h>

#include <random>
#include <vector>

namespace pepeseg {
namespace {

TEST(Iou, MatchesHandComputedShares) {
  const std::vector<uint8_t> a = {1, 1, 0, 0, 255}, b = {1, 0, 1, 0, 1}, none(5, 0);
  EXPECT_DOUBLE_EQ(Iou(a, b), 0.5);  // 2 of 4
  EXPECT_DOUBLE_EQ(Iou(a, a), 1.0);
  EXPECT_DOUBLE_EQ(Iou(a, none), 0.0);
  EXPECT_DOUBLE_EQ(Iou(none, none), 1.0);
}

TEST(Iou, LeavesOutIgnoredPixels) {
  const std::vector<uint8_t> a = {1, 1, 0, 0}, b = {1, 0, 1, 0}, ignore = {0, 9, 0, 0};
  EXPECT_DOUBLE_EQ(Iou(a, b, ignore), 0.5);
  EXPECT_DOUBLE_EQ(Iou(a, b, std::vector<uint8_t>(4, 1)), 1.0);
}

TEST(BoundaryWidth, IsAFiftiethOfTheDiagonal) {
  EXPECT_EQ(BoundaryWidth(480, 360), 12);  // 0.02 * 600
  EXPECT_EQ(BoundaryWidth(360, 480), 12);
  EXPECT_EQ(BoundaryWidth(640, 480), 16);
  EXPECT_EQ(BoundaryWidth(96, 64), 2);   // 2.31
  EXPECT_EQ(BoundaryWidth(105, 70), 3);  // 2.52
  EXPECT_EQ(BoundaryWidth(8, 6), 1);     // 0.2, at least 1
}

// Follows the definition: pads by one pixel of 0, erodes by 3x3 `distance` times, subtracts.
std::vector<uint8_t> NaiveBoundary(const std::vector<uint8_t>& mask, int width, int height,
                                   int distance) {
  const int padded_width = width + 2, padded_height = height + 2;
  std::vector<uint8_t> inner(static_cast<size_t>(padded_width) * padded_height);
  for (int i = 0; i < width * height; ++i) {
    inner[(i / width + 1) * padded_width + i % width + 1] = mask[i] != 0 ? 1 : 0;
  }
  for (int k = 0; k < distance; ++k) {
    std::vector<uint8_t> eroded(inner.size());
    for (int y = 1; y + 1 < padded_height; ++y) {
      for (int x = 1; x + 1 < padded_width; ++x) {
        uint8_t all = 1;
        for (int v = y - 1; v <= y + 1; ++v) {
          for (int u = x - 1; u <= x + 1; ++u) all &= inner[v * padded_width + u];
        }
        eroded[y * padded_width + x] = all;
      }
    }
    inner = std::move(eroded);
  }
  std::vector<uint8_t> boundary(mask.size());
  for (int i = 0; i < width * height; ++i) {
    const bool kept = inner[(i / width + 1) * padded_width + i % width + 1] != 0;
    boundary[i] = mask[i] != 0 && !kept ? 1 : 0;
  }
  return boundary;
}

TEST(MaskBoundary, MatchesRepeatedErosions) {
  std::mt19937 random(1);
  for (const auto& [width, height] : {std::pair(37, 29), {5, 40}, {40, 5}, {1, 1}, {64, 64}}) {
    for (const unsigned sparsity : {2U, 30U, 400U, 1U << 30}) {
      std::vector<uint8_t> mask(static_cast<size_t>(width) * height);
      for (uint8_t& pixel : mask) pixel = random() % sparsity != 0 ? 255 : 0;
      for (const int distance : {1, 2, 5, 12}) {
        EXPECT_EQ(MaskBoundary(mask, width, height, distance),
                  NaiveBoundary(mask, width, height, distance))
            << width << "x" << height << ", 1 in " << sparsity << ", " << distance;
      }
    }
  }
}

// A square [x, x + side) x [y, y + side) on 40x40, where the boundary is 1 pixel wide.
std::vector<uint8_t> Square(int x, int y, int side) {
  std::vector<uint8_t> mask(40 * 40);
  for (int i = 0; i < side * side; ++i) mask[(y + i / side) * 40 + x + i % side] = 1;
  return mask;
}

TEST(BoundaryIou, MatchesHandCountedBoundaries) {
  ASSERT_EQ(BoundaryWidth(40, 40), 1);
  // Rings of 36 pixels, one column apart: the two horizontal sides share 9 pixels each.
  EXPECT_DOUBLE_EQ(BoundaryIou(Square(5, 5, 10), Square(5, 5, 10), 40, 40), 1);
  EXPECT_DOUBLE_EQ(BoundaryIou(Square(5, 5, 10), Square(6, 5, 10), 40, 40), 18.0 / (72 - 18));
  // The ring of the smaller one lies inside the larger one's: nothing in common.
  EXPECT_DOUBLE_EQ(BoundaryIou(Square(5, 5, 10), Square(6, 6, 8), 40, 40), 0);
  // The image's own border is a boundary.
  EXPECT_DOUBLE_EQ(BoundaryIou(Square(0, 0, 10), Square(0, 0, 10), 40, 40), 1);
  const std::vector<uint8_t> none(40 * 40);
  EXPECT_DOUBLE_EQ(BoundaryIou(Square(5, 5, 10), none, 40, 40), 0);
  EXPECT_DOUBLE_EQ(BoundaryIou(none, none, 40, 40), 1);
}

TEST(BoundaryIou, LeavesOutIgnoredPixels) {
  std::vector<uint8_t> ignore(40 * 40);
  for (int y = 0; y < 40; ++y) {  // the vertical sides of both rings
    for (const int x : {5, 6, 14, 15}) ignore[y * 40 + x] = 1;
  }
  EXPECT_DOUBLE_EQ(BoundaryIou(Square(5, 5, 10), Square(6, 5, 10), 40, 40, ignore), 1);
}

// A ring of two pixels around the truth is void. A prediction that ends within it is right: its own
// boundary, which lies in the ring in part, must not count.
TEST(BoundaryIou, DoesNotDependOnThePredictionInIgnoredPixels) {
  const std::vector<uint8_t> truth = Square(10, 10, 20), wide = Square(8, 8, 24);
  std::vector<uint8_t> ignore(40 * 40);
  for (size_t i = 0; i < ignore.size(); ++i) ignore[i] = wide[i] != truth[i] ? 1 : 0;
  for (const auto& prediction : {truth, wide, Square(9, 9, 22)}) {
    EXPECT_DOUBLE_EQ(BoundaryIou(prediction, truth, 40, 40, ignore), 1);
  }
  EXPECT_LT(BoundaryIou(Square(7, 7, 26), truth, 40, 40, ignore), 1) << "beyond the ring";
}

double Ari(const std::vector<int32_t>& a, const std::vector<int32_t>& b) {
  EXPECT_EQ(AdjustedRand(a, b), AdjustedRand(b, a));
  return AdjustedRand(a, b);
}

TEST(AdjustedRand, MatchesValuesByHand) {
  // Of 15 pairs, 2 are together in both partitions, 6 in `a`, 3 in `b`: (2 - 1.2) / (4.5 - 1.2).
  EXPECT_NEAR(Ari({1, 1, 1, 2, 2, 2}, {1, 1, 2, 2, 3, 3}), 0.8 / 3.3, 1e-12);
  // Of 6 pairs, 0 are together in both, 2 in `a`, 2 in `b`: (0 - 2/3) / (2 - 2/3).
  EXPECT_NEAR(Ari({1, 1, 2, 2}, {1, 2, 1, 2}), -0.5, 1e-12);
  // A partition with a single part agrees with any other one only by chance.
  EXPECT_NEAR(Ari({1, 1, 1, 1}, {1, 1, 2, 2}), 0, 1e-12);
}

TEST(AdjustedRand, DependsOnThePartitionNotOnTheIds) {
  EXPECT_EQ(Ari({0, 0, 7, 7, 3}, {-5, -5, 2, 2, 0}), 1);
  EXPECT_EQ(Ari({4, 4, 4}, {9, 9, 9}), 1);
  EXPECT_EQ(Ari({1, 2, 3}, {3, 1, 2}), 1);
  EXPECT_EQ(Ari({}, {}), 1);
}

TEST(AdjustedRand, IsAboutZeroForIndependentIds) {
  std::mt19937 random(3);
  std::vector<int32_t> a, b;
  for (int i = 0; i < 20'000; ++i) {
    a.push_back(static_cast<int32_t>(random() % 5));
    b.push_back(static_cast<int32_t>(random() % 7));
  }
  EXPECT_NEAR(Ari(a, b), 0, 0.005);
}

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

TEST(IouByThreshold, LeavesOutPixelsOutsideTheMask) {
  const std::vector<float> similarity = {0.9f, 0.8f, 0.9f, 0.1f};
  const std::vector<uint8_t> truth = {1, 1, 0, 0}, mask = {1, 1, 0, 1};
  const std::vector<double> thresholds = {0.5, 0.85};
  EXPECT_EQ(IouByThreshold(similarity, mask, truth, {}, thresholds), (std::vector<double>{1, 0.5}));
  EXPECT_EQ(IouByThreshold(similarity, {}, truth, {}, thresholds),
            (std::vector<double>{2.0 / 3, 1.0 / 3}));
  EXPECT_EQ(IouByThreshold(similarity, mask, truth, std::vector<uint8_t>{0, 1, 0, 0}, thresholds),
            (std::vector<double>{1, 1}));
}

TEST(IouByThreshold, MatchesHandCountedMasks) {
  const std::vector<uint8_t> truth = {1, 1, 1, 1, 0, 0, 0, 0};
  const std::vector<float> similarity = {0.9f, 0.8f, 0.6f, 0.1f, 0.85f, -1, 0.6f, 0.2f};
  const std::vector<double> thresholds = {-2, 0.5, 0.7, 0.82, 0.95};
  // Pixels over each threshold, inside and outside the truth: 4 and 4, 3 and 2, 2 and 1, 1 and 1,
  // none.
  EXPECT_EQ(IouByThreshold(similarity, {}, truth, {}, thresholds),
            (std::vector<double>{4.0 / 8, 3.0 / 6, 2.0 / 5, 1.0 / 5, 0}));
}

TEST(IouByThreshold, IsStrictAndInSinglePrecisionAsSegmentIs) {
  const std::vector<uint8_t> truth = {1, 1, 1, 1, 0, 0, 0, 0};
  const std::vector<float> similarity(8, 0.7f);
  EXPECT_EQ(IouByThreshold(similarity, {}, truth, {}, std::vector{0.7}), std::vector{0.0});
  EXPECT_EQ(IouByThreshold(similarity, {}, truth, {}, std::vector{0.699}), std::vector{0.5});
}

TEST(IouByThreshold, LeavesOutIgnoredPixels) {
  const std::vector<uint8_t> truth = {1, 1, 1, 1, 0, 0, 0, 0}, all(8, 1);
  const std::vector<uint8_t> ignore = {0, 0, 0, 1, 1, 1, 1, 1};
  const std::vector<float> similarity = {0.9f, 0.8f, 0.6f, 0.9f, 0.9f, 0.9f, 0.9f, 0.9f};
  EXPECT_EQ(IouByThreshold(similarity, {}, truth, ignore, std::vector{0.7, 0.95}),
            (std::vector<double>{2.0 / 3, 0}));
  EXPECT_EQ(IouByThreshold(similarity, {}, truth, all, std::vector{0.7}), std::vector{1.0});
}

}  // namespace
}  // namespace pepeseg
