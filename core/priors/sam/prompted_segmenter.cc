#include "core/priors/sam/prompted_segmenter.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <numeric>
#include <opencv2/imgproc.hpp>

#include "core/priors/sam/grid_mask.h"

namespace pepeseg {

absl::StatusOr<SamEmbedding> PromptedSegmenter::Embedding() {
  return absl::UnimplementedError("this segmenter gives no embedding");
}
absl::Status PromptedSegmenter::SetEmbedding(const SamEmbedding&) {
  return absl::UnimplementedError("this segmenter takes no embedding");
}
absl::StatusOr<PromptAnswers> PromptedSegmenter::SegmentByMask(const MaskPrompt&) {
  return absl::UnimplementedError("this segmenter takes no mask as a prompt");
}

PromptAnswers AnswerGrid(int photo_width, int photo_height, int extent) {
  PromptAnswers grid;
  // SAM answers with a square of cells, which the longer side of the photograph fills.
  grid.cells_per_pixel = static_cast<double>(extent) / std::max(photo_width, photo_height);
  const auto cells = [&](int pixels) {
    return std::max(1, static_cast<int>(std::lround(pixels * grid.cells_per_pixel)));
  };
  grid.width = cells(photo_width);
  grid.height = cells(photo_height);
  return grid;
}

std::vector<float> WithoutPadding(std::span<const float> squares, int extent,
                                  const PromptAnswers& grid) {
  std::vector<float> cells;
  const size_t square = static_cast<size_t>(extent) * extent;
  cells.reserve(squares.size() / square * grid.width * grid.height);
  for (size_t first = 0; first < squares.size(); first += square) {
    for (int y = 0; y < grid.height; ++y) {
      const auto row = squares.subspan(first + static_cast<size_t>(y) * extent, grid.width);
      cells.insert(cells.end(), row.begin(), row.end());
    }
  }
  return cells;
}

// Visits the squares with a stride near count times the golden section, which spreads any number of
// first points evenly. The stride shares no divisor with the count, so that each square comes once.
std::vector<PromptPoint> GridPoints(const Image& photo, int points_per_side) {
  const int count = points_per_side * points_per_side;
  int stride = std::max(1, static_cast<int>(std::lround(count * 0.381966)));
  while (count > 0 && std::gcd(stride, count) != 1) ++stride;
  std::vector<PromptPoint> points;
  for (int i = 0; i < count; ++i) {
    // 64 bits: i * stride grows with the square of the number of points.
    const int at = static_cast<int>(int64_t{i} * stride % count);
    const auto place = [&](int index, int size) {
      return static_cast<float>((index + 0.5) * size / points_per_side);
    };
    points.push_back({place(at % points_per_side, photo.width),
                      place(at / points_per_side, photo.height), true});
  }
  return points;
}

std::vector<PromptPoint> RegionPoints(const MaskSet& masks) {
  const PromptAnswers grid = AnswerGrid(masks.width, masks.height);
  std::vector<PromptPoint> points;
  for (int k = 0; k < masks.num_masks; ++k) {
    const BinaryMask mask = masks.Extract(k);
    const cv::Mat from(masks.height, masks.width, CV_8U, const_cast<uint8_t*>(mask.pixels.data()));
    cv::Mat to;
    cv::resize(from, to, {grid.width, grid.height}, 0, 0, cv::INTER_NEAREST);
    for (const cv::Point& cell : DeepestCells(to, 1)) {
      points.push_back({static_cast<float>((cell.x + 0.5) / grid.cells_per_pixel),
                        static_cast<float>((cell.y + 0.5) / grid.cells_per_pixel), true});
    }
  }
  return points;
}

}  // namespace pepeseg
