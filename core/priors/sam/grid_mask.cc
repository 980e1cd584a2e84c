#include "core/priors/sam/grid_mask.h"

#include <bit>
#include <cassert>
#include <opencv2/imgproc.hpp>

namespace pepeseg {

GridMask::GridMask(std::span<const float> logits, float threshold)
    : bits_((logits.size() + 63) / 64, 0) {
  for (size_t i = 0; i < logits.size(); ++i) {
    if (logits[i] <= threshold) continue;
    bits_[i / 64] |= uint64_t{1} << (i % 64);
    ++area_;
  }
}

int64_t GridMask::Common(const GridMask& other) const {
  assert(bits_.size() == other.bits_.size());
  int64_t common = 0;
  for (size_t i = 0; i < bits_.size(); ++i) common += std::popcount(bits_[i] & other.bits_[i]);
  return common;
}

double GridMask::Iou(const GridMask& other) const {
  const int64_t common = Common(other), united = area_ + other.area_ - common;
  return united == 0 ? 0 : static_cast<double>(common) / static_cast<double>(united);
}

GridMask GridMask::Without(const GridMask& other) const {
  GridMask rest = *this;
  rest.area_ = 0;
  for (size_t i = 0; i < bits_.size(); ++i) {
    rest.bits_[i] &= ~other.bits_[i];
    rest.area_ += std::popcount(rest.bits_[i]);
  }
  return rest;
}

cv::Mat GridMask::Image(int width, int height) const {
  cv::Mat image(height, width, CV_8U);
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      image.at<uint8_t>(y, x) = Holds(static_cast<size_t>(y) * width + x) ? 1 : 0;
    }
  }
  return image;
}

std::vector<cv::Point> DeepestCells(const cv::Mat& mask, int count) {
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

}  // namespace pepeseg
