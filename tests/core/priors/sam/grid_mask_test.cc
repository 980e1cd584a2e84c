#include "core/priors/sam/grid_mask.h"

#include <gtest/gtest.h>

#include <opencv2/imgproc.hpp>
#include <random>
#include <vector>

namespace pepeseg {
namespace {

// Overlapping boxes and discs, some of which touch the image's rim.
cv::Mat RandomThings(uint64_t seed) {
  std::mt19937_64 engine(seed);
  const auto draw = [&](int most) { return static_cast<int>(engine() % most); };
  cv::Mat mask(70, 90, CV_8U, cv::Scalar(0));
  for (int i = 0; i < 4; ++i) {
    cv::circle(mask, {draw(90), draw(70)}, 3 + draw(15), cv::Scalar(1), cv::FILLED);
    cv::rectangle(mask, cv::Rect(draw(80), draw(60), 2 + draw(20), 2 + draw(9)), cv::Scalar(1),
                  cv::FILLED);
    cv::circle(mask, {draw(90), draw(70)}, draw(5), cv::Scalar(0), cv::FILLED);
  }
  return mask;
}

// The same by OpenCV's distance transform, in a frame of zeros.
std::vector<cv::Point> CellsByOpenCv(const cv::Mat& mask, int count) {
  cv::Mat framed, depth;
  cv::copyMakeBorder(mask, framed, 1, 1, 1, 1, cv::BORDER_CONSTANT, cv::Scalar(0));
  cv::distanceTransform(framed, depth, cv::DIST_L2, cv::DIST_MASK_PRECISE);
  std::vector<cv::Point> cells;
  while (static_cast<int>(cells.size()) < count) {
    double deepest = 0;
    cv::Point at;
    cv::minMaxLoc(depth, nullptr, &deepest, nullptr, &at);
    if (deepest <= 0) break;
    cells.emplace_back(at.x - 1, at.y - 1);
    cv::circle(depth, at, cvCeil(deepest), cv::Scalar(0), cv::FILLED);
  }
  return cells;
}

TEST(DeepestCells, AreThoseOfOpenCvsDistances) {
  for (uint64_t seed = 0; seed < 50; ++seed) {
    const cv::Mat mask = RandomThings(seed);
    EXPECT_EQ(DeepestCells(mask, 6), CellsByOpenCv(mask, 6)) << seed;
  }
}

TEST(DeepestCells, AreNoneInAnEmptyMask) {
  EXPECT_TRUE(DeepestCells(cv::Mat(5, 7, CV_8U, cv::Scalar(0)), 2).empty());
}

TEST(DeepestCells, LieInTheMiddleOfAFullImage) {
  const auto cells = DeepestCells(cv::Mat(5, 9, CV_8U, cv::Scalar(1)), 1);
  ASSERT_EQ(cells.size(), 1u);
  EXPECT_EQ(cells[0].y, 2);
}

TEST(GridMask, TakesTheCellsOfASquare) {
  constexpr int kExtent = 64, kWidth = 50, kHeight = 37;
  std::mt19937 engine(5);
  std::vector<uint32_t> square(kExtent * kExtent / 32);
  for (uint32_t& word : square) word = engine();
  const GridMask mask(square, kExtent, kWidth, kHeight);
  int64_t area = 0;
  for (int i = 0; i < kWidth * kHeight; ++i) {
    const int bit = i / kWidth * kExtent + i % kWidth;
    const bool holds = (square[bit / 32] >> (bit % 32) & 1) != 0;
    ASSERT_EQ(mask.Holds(i), holds) << i;
    area += holds;
  }
  EXPECT_EQ(mask.area(), area);
}

TEST(GridMask, IsADuplicateAboveAnIou) {
  const std::vector<float> five = {1, 1, 1, 1, 1, -1}, four = {1, 1, 1, 1, -1, -1};
  const GridMask large(five, 0), small(four, 0);
  EXPECT_TRUE(large.IsDuplicate(small, 0.79));
  EXPECT_FALSE(large.IsDuplicate(small, 0.8));
  EXPECT_FALSE(GridMask().IsDuplicate(GridMask(), 0.5));
}

}  // namespace
}  // namespace pepeseg
