#include "core/evaluate/boundary_iou.h"

#include <algorithm>
#include <cassert>
#include <cmath>

#include "core/evaluate/metrics.h"

namespace pepeseg {
namespace {

constexpr double kBoundaryShare = 0.02;  // of the image's diagonal

}  // namespace

int BoundaryWidth(int width, int height) {
  return std::max(1, static_cast<int>(std::lround(kBoundaryShare * std::hypot(width, height))));
}

// A pixel outlives the erosions when its whole window of side 2 * distance + 1 is in the mask: runs
// of that length along the rows, then, of their middles, along the columns.
std::vector<uint8_t> MaskBoundary(std::span<const uint8_t> mask, int width, int height,
                                  int distance) {
  assert(mask.size() == static_cast<size_t>(width) * height);
  const int window = 2 * distance + 1;
  std::vector<uint8_t> boundary(mask.size());
  std::vector<uint8_t> middle(width);      // of a run in this row
  std::vector<int32_t> column_run(width);  // middles above each other, ending in this row
  for (int y = 0; y < height; ++y) {
    const size_t row = static_cast<size_t>(y) * width;
    std::fill(middle.begin(), middle.end(), uint8_t{0});
    for (int x = 0, run = 0; x < width; ++x) {
      const bool inside = mask[row + x] != 0;
      boundary[row + x] = inside ? 1 : 0;
      run = inside ? run + 1 : 0;
      if (run >= window) middle[x - distance] = 1;
    }
    for (int x = 0; x < width; ++x) {
      column_run[x] = middle[x] != 0 ? column_run[x] + 1 : 0;
      if (column_run[x] >= window) boundary[row - static_cast<size_t>(distance) * width + x] = 0;
    }
  }
  return boundary;
}

double BoundaryIou(std::span<const uint8_t> prediction, std::span<const uint8_t> truth, int width,
                   int height, std::span<const uint8_t> ignore) {
  const int distance = BoundaryWidth(width, height);
  return Iou(MaskBoundary(prediction, width, height, distance),
             MaskBoundary(truth, width, height, distance), ignore);
}

}  // namespace pepeseg
