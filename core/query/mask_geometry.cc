#include "core/query/mask_geometry.h"

#include <algorithm>
#include <cassert>
#include <cstring>
#include <iterator>
#include <limits>
#include <utility>
#include <vector>

namespace pepeseg {
namespace {

struct MaskExtent {
  int left = std::numeric_limits<int>::max(), top = left, right = -1, bottom = -1;  // inclusive
};

// Returns the bounding box of the pixels that are not 0; right < 0: there are none.
MaskExtent BoundsOf(std::span<const uint8_t> mask, int width, int height) {
  MaskExtent bounds;
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      if (mask[static_cast<size_t>(y) * width + x] == 0) continue;
      bounds.left = std::min(bounds.left, x), bounds.right = std::max(bounds.right, x);
      bounds.top = std::min(bounds.top, y), bounds.bottom = std::max(bounds.bottom, y);
    }
  }
  return bounds;
}

// Second phase of the exact Euclidean distance transform of Meijster, Roerdink and Hesselink
// (2000), in integers: turns distances along the columns into squared distances in the plane, one
// scanline at a time. The squared distance at x is the lower envelope of the parabolas (x - site)^2
// + column[site]^2.
class RowDistances {
 public:
  explicit RowDistances(int size) : site_(size), start_(size), squared_(size) {}

  std::span<const int64_t> Compute(std::span<const int> column) {
    const auto size = static_cast<int64_t>(column.size());
    const auto squared = [&](int64_t x, int64_t site) {
      return (x - site) * (x - site) + int64_t{column[site]} * column[site];
    };
    int64_t last = 0;
    site_[0] = start_[0] = 0;
    for (int64_t u = 1; u < size; ++u) {
      while (last >= 0 && squared(start_[last], site_[last]) > squared(start_[last], u)) --last;
      if (last < 0) {
        last = 0;
        site_[0] = u;
        continue;
      }
      // The first x at which the parabola of u is lower than that of the site before it.
      const int64_t i = site_[last];
      const int64_t start = 1 + (squared(0, u) - squared(0, i)) / (2 * (u - i));
      if (start >= size) continue;
      site_[++last] = u;
      start_[last] = start;
    }
    for (int64_t x = size - 1; x >= 0; --x) {
      squared_[x] = squared(x, site_[last]);
      if (x == start_[last]) --last;
    }
    return squared_;
  }

 private:
  std::vector<int64_t> site_, start_, squared_;
};

}  // namespace

// memchr and memrchr look at many pixels at once, and only at those that may widen the box, once
// the row is known to have a pixel.
void FindBox(std::span<const uint8_t> mask, int width, int (&box)[4]) {
  const int height = static_cast<int>(mask.size()) / width;
  int min_x = width, max_x = -1, min_y = height, max_y = -1;
  for (int y = 0; y < height; ++y) {
    const uint8_t* const row = mask.data() + static_cast<size_t>(y) * width;
    const void* const first = std::memchr(row, 1, static_cast<size_t>(width));
    if (first == nullptr) continue;
    min_x = std::min(min_x, static_cast<int>(static_cast<const uint8_t*>(first) - row));
    const uint8_t* const right = row + max_x + 1;
    const void* const last = memrchr(right, 1, static_cast<size_t>(row + width - right));
    if (last != nullptr) max_x = static_cast<int>(static_cast<const uint8_t*>(last) - row);
    min_y = std::min(min_y, y);
    max_y = y;
  }
  std::fill(std::begin(box), std::end(box), 0);
  if (max_y < 0) return;
  const int found[] = {min_x, min_y, max_x - min_x + 1, max_y - min_y + 1};
  std::copy(std::begin(found), std::end(found), box);
}

double IouOf(const BoxEdges& a, const BoxEdges& b) {
  const BoxEdges both = {std::max(a.x0, b.x0), std::max(a.y0, b.y0), std::min(a.x1, b.x1),
                         std::min(a.y1, b.y1)};
  const double common = both.Area();
  return common == 0 ? 0 : common / (a.Area() + b.Area() - common);
}

DeepPixel FindDeepest(std::span<const uint8_t> mask, int width, int height) {
  assert(mask.size() == static_cast<size_t>(width) * height);
  const MaskExtent bounds = BoundsOf(mask, width, height);
  if (bounds.right < 0) return {};
  // Pixels around the bounding box are outside the mask, so a border of one pixel suffices.
  const int columns = bounds.right - bounds.left + 3, rows = bounds.bottom - bounds.top + 3;
  std::vector<int> distance(static_cast<size_t>(columns) *
                            rows);  // to the nearest outside pixel in the column
  const auto row_of = [&](int y) { return &distance[static_cast<size_t>(y) * columns]; };
  for (int y = 1; y + 1 < rows; ++y) {
    const uint8_t* in = &mask[static_cast<size_t>(bounds.top + y - 1) * width + bounds.left];
    for (int x = 1; x + 1 < columns; ++x) {
      row_of(y)[x] = in[x - 1] != 0 ? row_of(y - 1)[x] + 1 : 0;
    }
  }
  for (int y = rows - 2; y > 0; --y) {
    for (int x = 1; x + 1 < columns; ++x) {
      row_of(y)[x] = std::min(row_of(y)[x], row_of(y + 1)[x] + 1);
    }
  }
  DeepPixel deepest;
  RowDistances distances(columns);
  for (int y = 1; y + 1 < rows; ++y) {
    const auto squared = distances.Compute({row_of(y), static_cast<size_t>(columns)});
    const auto found = std::max_element(squared.begin(), squared.end());
    if (*found <= deepest.squared_depth) continue;
    deepest.squared_depth = *found;
    deepest.pixel = {bounds.left + static_cast<int>(found - squared.begin()) - 1,
                     bounds.top + y - 1};
  }
  return deepest;
}

void SetMask(BinaryMask mask, SegmentResult& result) {
  result.mask = std::move(mask);
  FindBox(result.mask.pixels, result.width, result.box);
  result.area = 0;
  double sum = 0;
  for (size_t pixel = 0; pixel < result.mask.pixels.size(); ++pixel) {
    if (result.mask.pixels[pixel] == 0) continue;
    ++result.area;
    sum += result.similarity[pixel];
  }
  result.score = result.area > 0 ? sum / static_cast<double>(result.area) : 0;
}

BoxEdges EdgesIn(const BoxPrompt& box, int width, int height) {
  return {std::max(0.0, box.x), std::max(0.0, box.y), std::min<double>(width, box.x + box.width),
          std::min<double>(height, box.y + box.height)};
}

double CutToBox(const BoxPrompt& box, SegmentResult& result) {
  const BoxEdges asked = EdgesIn(box, result.width, result.height);
  const auto [x, y, width, height] = result.box;
  const BoxEdges found = {double(x), double(y), double(x + width), double(y + height)};
  const double agreement = IouOf(asked, found);
  BinaryMask cut = std::move(result.mask);
  for (size_t pixel = 0; pixel < cut.pixels.size(); ++pixel) {
    const double column = static_cast<double>(pixel % result.width) + 0.5;
    const double row = static_cast<double>(pixel / result.width) + 0.5;
    const bool kept = column > asked.x0 - kBoxSlack && column < asked.x1 + kBoxSlack &&
                      row > asked.y0 - kBoxSlack && row < asked.y1 + kBoxSlack;
    if (!kept) cut.pixels[pixel] = 0;
  }
  SetMask(std::move(cut), result);
  return agreement;
}

PixelIndex DeepestPixel(std::span<const uint8_t> mask, int width, int height) {
  const DeepPixel deepest = FindDeepest(mask, width, height);
  assert(deepest.squared_depth > 0);
  return deepest.pixel;
}

}  // namespace pepeseg
