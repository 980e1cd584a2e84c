#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <vector>

#include "kernels/math/hd.h"

// Bilinear enlargement of masks of cells in the integers of OpenCV's warpAffine, whose pixels it
// returns exactly: coordinates in 1/32 cell, cells outside repeat the border.
namespace pepeseg {

// Where a pixel lies along one side of the grid of cells.
struct WarpedCell {
  int first, second;  // the cells around it; the same beyond the border
  int part;           // 0..31, distance from `first` in 1/32 cell
};

// Returns the cells of the pixels of a side. Centres correspond: cell + 0.5 = scale (pixel + 0.5).
// OpenCV rounds the parts of a column's coordinate separately, and those of a scanline's together.
inline std::vector<WarpedCell> CellsOfPixels(double scale, int num_pixels, int num_cells,
                                             bool columns) {
  constexpr double kFixed = 1024;  // ten bits after the point
  constexpr int64_t kRound = 16;   // half of 1/32 cell
  const double shift = 0.5 * scale - 0.5;
  const int last = num_cells - 1;
  std::vector<WarpedCell> cells;
  for (int pixel = 0; pixel < num_pixels; ++pixel) {
    const int64_t fixed = columns
                              ? std::llrint(scale * pixel * kFixed) + std::llrint(shift * kFixed)
                              : std::llrint((scale * pixel + shift) * kFixed);
    const auto at = static_cast<int>((fixed + kRound) >> 5);
    const int cell = at >> 5;
    cells.push_back({std::clamp(cell, 0, last), std::clamp(cell + 1, 0, last), at & 31});
  }
  return cells;
}

// Returns 1024 times the interpolated value of a mask at a pixel.
PEPESEG_HD int WarpedLogit(const int8_t* mask, int extent, const WarpedCell& column,
                                  const WarpedCell& row) {
  const int8_t *top = mask + row.first * extent, *bottom = mask + row.second * extent;
  const int above = (32 - column.part) * top[column.first] + column.part * top[column.second];
  const int below = (32 - column.part) * bottom[column.first] + column.part * bottom[column.second];
  return (32 - row.part) * above + row.part * below;
}

}  // namespace pepeseg
