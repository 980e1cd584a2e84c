#pragma once

#include "kernels/math/blend.h"
#include "kernels/render_scratch.h"

// Which pixels, and therefore which tiles, a splat can reach. Offsets and extents are in pixels.
// Splats are counted and listed by the same code, because the counts size the lists.

namespace pepeseg {

// Factor on the squared extent of a splat, so that rounding never loses a pixel that passes the
// test of the power.
inline constexpr float kExtentSlack = 1.0002f;

// Half the width and height, in pixels, of the ellipse in which the power is above min_power.
template <class T>
struct HalfExtent {
  T width, height;
};
// The ellipse ends where -power = -min_power. Its half width is the root of that times the
// covariance's xx = conic_yy * determinant, over kHalfLog2E. 0 if min_power >= 0.
template <class T>
PEPESEG_HD HalfExtent<T> SplatHalfExtent(T min_power, T root_yy, T conic_yy, T determinant) {
  const T reach = Sqrt(Max(T(0.0f), T(-kExtentSlack) * min_power));
  return {reach * Sqrt(conic_yy * determinant * T(1 / kHalfLog2E)), reach / root_yy};
}

// The ellipse in which a splat's power is above min_power, relative to its mean: the scanline at
// offset y covers shear * y +- waist * sqrt(1 - y^2 / half_height^2).
struct SplatExtent {
  float half_height;
  float shear;        // x of the middle of a scanline over its y
  float waist;        // half the width at y = 0
  float rightmost;    // y of the rightmost point; the leftmost is at -rightmost
  float inv_height2;  // 1 / half_height^2
};
// From the triangular root of the conic (PowerRoot).
PEPESEG_HD SplatExtent MakeSplatExtent(const Splat& splat) {
  const float norm = ::sqrtf(splat.root_xy * splat.root_xy + splat.root_yy * splat.root_yy);
  return {splat.half_height, -splat.root_xy / splat.root_xx,
          splat.half_height * splat.root_yy / splat.root_xx,
          -splat.half_height * splat.root_xy / norm, 1 / (splat.half_height * splat.half_height)};
}

// Smallest and largest x that the ellipse reaches within the band of scanlines top..bottom. All are
// offsets from the mean. Exact, because the part of an ellipse within a band is convex. The band
// must meet the ellipse.
struct BandCover {
  float left, right;
};
PEPESEG_HD BandCover CoverOfBand(const SplatExtent& extent, float top, float bottom) {
  const float first = Max(top, -extent.half_height);
  const float last = Max(first, Min(bottom, extent.half_height));
  const float right_dy = Min(Max(extent.rightmost, first), last);
  const float left_dy = Min(Max(-extent.rightmost, first), last);
  const float right = ::sqrtf(Max(0.0f, 1 - right_dy * right_dy * extent.inv_height2));
  const float left = ::sqrtf(Max(0.0f, 1 - left_dy * left_dy * extent.inv_height2));
  return {extent.shear * left_dy - extent.waist * left,
          extent.shear * right_dy + extent.waist * right};
}

// Number of tiles of kTileSize pixels a side, those cut by the image's edge included.
struct TileGrid {
  int num_x;
  int num_y;
};

// Returns `tile` clamped to 0..end. It is clamped before the conversion, because a splat may reach
// beyond the range of int.
PEPESEG_HD int ClampToTiles(float tile, int end) {
  return static_cast<int>(Min(Max(tile, 0.0f), static_cast<float>(end)));
}

// Rows [first, end) of tiles that hold a pixel centre within the splat's height.
struct TileRows {
  SplatExtent extent;
  int first, end;
};
PEPESEG_HD_SAME_BITS TileRows TileRowsOf(Splat splat, int num_rows) {
  constexpr float kFirst = 0.5f, kLast = kTileSize - 0.5f, kInvSize = 1.0f / kTileSize;
  const SplatExtent extent = MakeSplatExtent(splat);
  const float top = splat.y - extent.half_height, bottom = splat.y + extent.half_height;
  return {extent, ClampToTiles(::ceilf((top - kLast) * kInvSize), num_rows),
          ClampToTiles(::floorf((bottom - kFirst) * kInvSize) + 1, num_rows)};
}
// The tiles of row `tile_y` that may hold a pixel centre within the ellipse at (x, y). Its count is
// 0 or less if there are none.
PEPESEG_HD_SAME_BITS TileRun TileRunOf(SplatExtent extent, float x, float y, int tile_y,
                                       int num_columns) {
  constexpr float kFirst = 0.5f, kLast = kTileSize - 0.5f, kInvSize = 1.0f / kTileSize;
  const float top = static_cast<float>(tile_y * kTileSize) - y;
  const BandCover cover = CoverOfBand(extent, top + kFirst, top + kLast);
  const int first = ClampToTiles(::ceilf((x + cover.left - kLast) * kInvSize), num_columns);
  const int end = ClampToTiles(::floorf((x + cover.right - kFirst) * kInvSize) + 1, num_columns);
  return {tile_y * num_columns + first, end - first};
}

// Calls fn(run) for the runs of tiles that the splat reaches, row by row from the top. A tile
// counts if the ellipse meets the rectangle spanned by its pixel centres; this test is exact up to
// kExtentSlack and rounding.
template <class Fn>
PEPESEG_HD void ForEachTileRun(const Splat& splat, const TileGrid& grid, Fn&& fn) {
  const TileRows rows = TileRowsOf(splat, grid.num_y);
  for (int tile_y = rows.first; tile_y < rows.end; ++tile_y) {
    const TileRun run = TileRunOf(rows.extent, splat.x, splat.y, tile_y, grid.num_x);
    if (run.count > 0) fn(run);
  }
}

}  // namespace pepeseg
