#include "core/priors/sam/mask_logits.h"

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <opencv2/imgproc.hpp>

namespace pepeseg {
namespace {

constexpr float kLogitOfCell = 4;  // for each cell of distance from the border

}  // namespace

cv::Mat SignedDistance(const cv::Mat& mask) {
  cv::Mat inside, outside;
  cv::distanceTransform(mask, inside, cv::DIST_L2, cv::DIST_MASK_PRECISE);
  cv::distanceTransform(1 - mask, outside, cv::DIST_L2, cv::DIST_MASK_PRECISE);
  return inside - outside;
}

std::vector<float> LogitsOfDistance(const cv::Mat& distance, const PromptAnswers& grid,
                                    int extent) {
  cv::Mat cells;
  cv::resize(distance, cells, cv::Size(grid.width, grid.height), 0, 0, cv::INTER_AREA);
  std::vector<float> logits(static_cast<size_t>(extent) * extent, -kMostLogit);
  const auto logit_of_pixel = static_cast<float>(kLogitOfCell * grid.cells_per_pixel);
  for (int y = 0; y < grid.height; ++y) {
    for (int x = 0; x < grid.width; ++x) {
      logits[static_cast<size_t>(y) * extent + x] =
          std::clamp(logit_of_pixel * cells.at<float>(y, x), -kMostLogit, kMostLogit);
    }
  }
  return logits;
}

std::vector<float> LogitsOfMask(const BinaryMask& mask, int width, int height, int extent) {
  const cv::Mat pixels(height, width, CV_8U, const_cast<uint8_t*>(mask.pixels.data()));
  return LogitsOfDistance(SignedDistance(pixels), AnswerGrid(width, height, extent), extent);
}

}  // namespace pepeseg
