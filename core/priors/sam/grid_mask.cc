#include "core/priors/sam/grid_mask.h"

#include <algorithm>
#include <bit>
#include <cassert>
#include <cmath>
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

// Appends the rows at the end of the bits, up to 32 cells at a time.
GridMask::GridMask(std::span<const uint32_t> square, int extent, int width, int height)
    : bits_((static_cast<size_t>(width) * height + 63) / 64, 0) {
  size_t to = 0;
  for (int y = 0; y < height; ++y) {
    const auto row = square.subspan(static_cast<size_t>(y) * extent / 32, extent / 32);
    for (int x = 0; x < width; x += 32) {
      const int count = std::min(32, width - x);
      const uint64_t cells = row[x / 32] & (~uint32_t{0} >> (32 - count));
      bits_[to / 64] |= cells << (to % 64);
      if (to % 64 + count > 64) bits_[to / 64 + 1] |= cells >> (64 - to % 64);
      area_ += std::popcount(cells);
      to += count;
    }
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

namespace {

// Returns the squared distance of each cell from the nearest cell outside the mask; cells outside
// the image are. Exact: down the columns first, then along the rows, where no cell farther than the
// best one so far can be nearer. OpenCV's transform is the same, but hands each small image to all
// cores.
cv::Mat SquaredDepth(const cv::Mat& mask) {
  const int width = mask.cols, height = mask.rows;
  cv::Mat above(height, width, CV_32S), depth(height, width, CV_32S, cv::Scalar(0));
  for (int x = 0; x < width; ++x) {
    for (int y = 0, distance = 0; y < height; ++y) {
      distance = mask.at<uint8_t>(y, x) == 0 ? 0 : distance + 1;
      above.at<int>(y, x) = distance;
    }
    for (int y = height - 1, distance = 0; y >= 0; --y) {
      distance = mask.at<uint8_t>(y, x) == 0 ? 0 : distance + 1;
      int& nearest = above.at<int>(y, x);
      nearest = std::min(nearest, distance);
    }
  }
  for (int y = 0; y < height; ++y) {
    const int* column = above.ptr<int>(y);
    for (int x = 0; x < width; ++x) {
      int best = column[x] * column[x];
      for (int step = 1; step * step < best; ++step) {
        for (const int at : {x - step, x + step}) {
          const int other = at < 0 || at >= width ? 0 : column[at];
          best = std::min(best, other * other + step * step);
        }
      }
      depth.at<int>(y, x) = best;
    }
  }
  return depth;
}

}  // namespace

// Takes the maximum of the distance to the border within the mask's box, clears a disc of that
// radius around it, and repeats.
std::vector<cv::Point> DeepestCells(const cv::Mat& mask, int count) {
  const cv::Rect box = cv::boundingRect(mask);
  std::vector<cv::Point> cells;
  if (box.empty()) return cells;
  cv::Mat depth = SquaredDepth(mask(box));
  while (static_cast<int>(cells.size()) < count) {
    double deepest = 0;
    cv::Point at;
    cv::minMaxLoc(depth, nullptr, &deepest, nullptr, &at);
    if (deepest <= 0) break;
    cells.push_back(at + box.tl());
    // Without the disc the next maximum would be a neighbour of this one.
    cv::circle(depth, at, cvCeil(std::sqrt(deepest)), cv::Scalar(0), cv::FILLED);
  }
  return cells;
}

std::vector<int8_t> QuarterLogits(std::span<const float> logits) {
  // Quarters of a logit within +-31.75. Only the sign and the values near 0, which place the
  // border, are needed.
  std::vector<int8_t> quarters;
  quarters.reserve(logits.size());
  for (const float logit : logits) {
    quarters.push_back(static_cast<int8_t>(std::lround(std::clamp(logit * 4, -127.0F, 127.0F))));
  }
  return quarters;
}

// Cell and pixel coordinates of OpenCV lie at centres: cell + 0.5 = scale * (pixel + 0.5). The
// logits are enlarged, not the mask: the border lies where the interpolated logit passes 0.
cv::Mat PixelsInside(const cv::Mat& logits, double cells_per_pixel, cv::Size size) {
  const double scale = cells_per_pixel, shift = 0.5 * scale - 0.5;
  const cv::Matx23d cell_from_pixel(scale, 0, shift, 0, scale, shift);
  cv::Mat warped;
  cv::warpAffine(logits, warped, cell_from_pixel, size, cv::INTER_LINEAR | cv::WARP_INVERSE_MAP,
                 cv::BORDER_REPLICATE);
  return warped > 0;
}

std::vector<PixelRun> PixelsOfLogits(std::span<const int8_t> logits, const PromptAnswers& grid,
                                     const View& view) {
  cv::Mat cells(grid.height, grid.width, CV_32F);
  for (int y = 0; y < grid.height; ++y) {
    for (int x = 0; x < grid.width; ++x) {
      cells.at<float>(y, x) = logits[static_cast<size_t>(y) * grid.width + x];
    }
  }
  const cv::Mat inside =
      PixelsInside(cells, grid.cells_per_pixel, {view.photo.width, view.photo.height});
  std::vector<PixelRun> runs;
  uint32_t pixel = 0;
  for (int y = 0; y < inside.rows; ++y) {
    for (int x = 0; x < inside.cols; ++x, ++pixel) {
      if (inside.at<uint8_t>(y, x) == 0) continue;
      if (!view.ignore.empty() && view.ignore[pixel] != 0) continue;
      if (runs.empty() || runs.back().last != pixel) runs.push_back({pixel, pixel});
      runs.back().last = pixel + 1;
    }
  }
  return runs;
}

}  // namespace pepeseg
