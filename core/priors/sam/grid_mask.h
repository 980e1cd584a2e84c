#pragma once

#include <algorithm>
#include <cstdint>
#include <opencv2/core.hpp>
#include <span>
#include <vector>

#include "core/priors/sam/prompted_segmenter.h"
#include "core/scene/capture.h"

namespace pepeseg {

// A mask on the grid of PromptAnswers, one bit a cell in reading order. Masks that are combined
// must be of the same grid.
class GridMask {
 public:
  GridMask() = default;
  // Holds the cells with a logit over `threshold`.
  GridMask(std::span<const float> logits, float threshold);
  // Holds the cells of the first `width` columns and `height` rows of a square of `extent` cells a
  // side whose bits are set; extent is a multiple of 32.
  GridMask(std::span<const uint32_t> square, int extent, int width, int height);

  int64_t area() const { return area_; }  // cells
  bool Holds(size_t cell) const { return (bits_[cell / 64] >> (cell % 64) & 1) != 0; }
  // Returns the number of cells that both masks hold.
  int64_t Common(const GridMask& other) const;
  // Returns the IoU, in [0, 1]; 0 where both are empty.
  double Iou(const GridMask& other) const;
  // Returns Iou(other) > most, for 0 < most < 1. Areas alone decide most cases.
  bool IsDuplicate(const GridMask& other, double most) const {
    const auto smaller = static_cast<double>(std::min(area_, other.area_));
    return smaller > most * static_cast<double>(std::max(area_, other.area_)) && Iou(other) > most;
  }
  // Returns this mask's cells that `other` does not hold.
  GridMask Without(const GridMask& other) const;
  // Returns the mask as an image of 0 and 1, [height, width].
  cv::Mat Image(int width, int height) const;

 private:
  std::vector<uint64_t> bits_;
  int64_t area_ = 0;
};

// Returns up to `count` cells that are farthest from the mask's border, the deepest first; the
// image's rim counts as a border. Each cell is farther from those before it than those are from the
// border. Returns fewer when the mask has no further cell.
std::vector<cv::Point> DeepestCells(const cv::Mat& mask, int count);

// Returns the logits in quarters, rounded and limited to [-127, 127]: a quarter of the memory, and
// finer differences move no border by a pixel.
std::vector<int8_t> QuarterLogits(std::span<const float> logits);

// Returns 255 for the pixels of an image of this size where the logits of the grid's cells, of type
// CV_32F, are positive, and 0 for the others. Logits are interpolated between the cells' centres.
cv::Mat PixelsInside(const cv::Mat& logits, double cells_per_pixel, cv::Size size);

// Returns the pixels of the view's photograph where the logits, [height, width] of the grid, are
// positive, without ignored ones, as ascending runs. Logits are interpolated between the centres of
// the cells, as in the network's own masks.
std::vector<PixelRun> PixelsOfLogits(std::span<const int8_t> logits, const PromptAnswers& grid,
                                     const View& view);

}  // namespace pepeseg
