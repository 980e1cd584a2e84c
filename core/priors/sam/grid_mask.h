#pragma once

#include <cstdint>
#include <opencv2/core.hpp>
#include <span>
#include <vector>

namespace pepeseg {

// A mask on the grid of PromptAnswers, a bit a cell in reading order.
class GridMask {
 public:
  GridMask() = default;
  // The cells whose logit is over `threshold`.
  GridMask(std::span<const float> logits, float threshold);

  int64_t area() const { return area_; }
  bool Holds(size_t cell) const { return (bits_[cell / 64] >> (cell % 64) & 1) != 0; }
  int64_t Common(const GridMask& other) const;
  double Iou(const GridMask& other) const;
  // The cells that `other` does not hold.
  GridMask Without(const GridMask& other) const;
  // As an image of 0 and 1, [height, width].
  cv::Mat Image(int width, int height) const;

 private:
  std::vector<uint64_t> bits_;
  int64_t area_ = 0;
};

// The cells that are farthest from the mask's border, the image's included: the farthest one, and
// up to `count` in all that are farther from the ones before than those are from the border. The
// mask has a cell.
std::vector<cv::Point> DeepestCells(const cv::Mat& mask, int count);

}  // namespace pepeseg
