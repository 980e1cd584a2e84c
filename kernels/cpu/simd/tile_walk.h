#pragma once

#include "kernels/cpu/simd/lanes.h"
#include "kernels/cpu/simd_kernels.h"
#include "kernels/math/blend.h"

// The walk over the entries of a tile that all forward blending shares, and the steps of it that
// the backward pass uses, too. The power of a splat is tested before the exponential, so that
// blocks that a splat does not reach cost little.

namespace pepeseg {
namespace HWY_NAMESPACE {

inline constexpr int kVectorsPerRow = kTileSize / kLanes;
// The walks work on a block of two vectors at a time, one below the other (16 lanes) or next to it:
// two chains of operations that do not wait for each other.
inline constexpr int kBlockRows = kVectorsPerRow == 1 ? 2 : 1;
inline constexpr int kBlockColumns = 2 / kBlockRows;  // in vectors

// Scanlines [first, end) of the tile that a splat can reach.
struct RowRange {
  int first, end;
};
PEPESEG_HD RowRange RowsInReach(const Splat& s, float tile_y) {
  const float center = s.y - tile_y - 0.5f;
  // Clamped to just outside the tile before the conversion to int: the values may be huge.
  const float first = Min(Max(center - s.half_height, -0.5f), 16.0f);
  const float end = Min(Max(center + s.half_height, -1.0f), 15.0f);
  const int first_row = static_cast<int>(first);
  return {first_row + (static_cast<float>(first_row) < first), static_cast<int>(end + 1.0f)};
}

// The splats of a tile are scattered in memory, so each is prefetched some entries ahead. A splat
// may span two cache lines.
inline constexpr int32_t kPrefetchAhead = 6;
PEPESEG_HD void PrefetchSplat(const TileSplats& tile, int32_t k) {
  if (k < 0 || k >= tile.count) return;
  const char* splat = reinterpret_cast<const char*>(tile.splats + tile.entries[k]);
  __builtin_prefetch(splat);
  __builtin_prefetch(splat + sizeof(Splat) - 1);
}

// A splat prepared for the loop over the pixels of a tile.
struct WalkedSplat {
  PowerRoot<float> root;
  Lanes root_xx, min_power, opacity;
  Lanes dx[kVectorsPerRow];  // offsets of the pixel columns from the mean, pixels
};
PEPESEG_HD WalkedSplat PrepareSplat(const Splat& s, float tile_x) {
  WalkedSplat out;
  out.root = {s.root_xx, s.root_xy, s.root_yy};
  out.root_xx = Lanes(s.root_xx);
  out.min_power = Lanes(s.min_power);
  out.opacity = Lanes(s.opacity);
  for (int i = 0; i < kVectorsPerRow; ++i) {
    out.dx[i] = Ramp(tile_x + 0.5f + static_cast<float>(i * kLanes)) - Lanes(s.x);
  }
  return out;
}

// A block: vector b = 0 is in scanline `row` at vector `column`, vector 1 below or next to it.
struct Block {
  int row, column;

  PEPESEG_HD int RowOf(int b) const { return row + (kBlockRows == 2 ? b : 0); }
  PEPESEG_HD int ColumnOf(int b) const { return column + (kBlockRows == 2 ? 0 : b); }
  PEPESEG_HD int PixelOf(int b) const { return RowOf(b) * kTileSize + ColumnOf(b) * kLanes; }
};
// The power of a splat (math/blend.h) at offsets (dx, dy) from its mean.
PEPESEG_HD Lanes PowerOf(const WalkedSplat& s, float dy, Lanes dx) {
  const PowerRow<float> row = PowerAtRow(s.root, dy);
  return Power(s.root_xx, PowerRow<Lanes>{Lanes(row.shift), Lanes(row.drop)}, dx);
}

// The pixels that a walk visits, as whole blocks.
struct WalkWindow {
  int first_row, end_row;
  int first_column, end_column;  // in vectors
};
inline constexpr WalkWindow kWholeTile = {0, kTileSize, 0, kVectorsPerRow};

// True while any pixel of the window is in play, with a transmittance above 0.
PEPESEG_HD bool AnyLivePixel(const WalkWindow& window, const float* transmittance) {
  Lanes most(0.0f);
  for (int y = window.first_row; y < window.end_row; ++y) {
    for (int i = window.first_column; i < window.end_column; ++i) {
      most = Max(most, Lanes::Load(transmittance + y * kTileSize + i * kLanes));
    }
  }
  return !None(Lanes(0.0f) < most);
}

// Blends one entry at the two vectors of a block. Returns a bit for each scanline with pixels that
// stop at this entry.
template <class Visit>
PEPESEG_HD uint32_t BlendBlock(const WalkedSplat& s, const Block& block, const float* dy,
                               float* transmittance, Visit&& visit) {
  Lanes power[2], before[2];
  LaneMask hit[2];
  for (int b = 0; b < 2; ++b) {
    power[b] = PowerOf(s, dy[b], s.dx[block.ColumnOf(b)]);
    before[b] = Lanes::Load(transmittance + block.PixelOf(b));
    hit[b] = (s.min_power <= power[b]) & (Lanes(0.0f) < before[b]);
  }
  if (None(hit[0] | hit[1])) return 0;
  Lanes alpha[2];
  for (int b = 0; b < 2; ++b) alpha[b] = Alpha(s.opacity, Exp2(power[b]));
  uint32_t stop_rows = 0;
  for (int b = 0; b < 2; ++b) {
    const Blended<Lanes> step = BlendStep(alpha[b], before[b]);
    const LaneMask stops = hit[b] & (step.transmittance < Lanes(kMinTransmittance));
    const LaneMask live = AndNot(stops, hit[b]);
    stop_rows |= static_cast<uint32_t>(!None(stops)) << block.RowOf(b);
    const Lanes kept = Select(stops, Lanes(0.0f) - before[b], before[b]);
    Select(live, step.transmittance, kept).Store(transmittance + block.PixelOf(b));
    visit(block.PixelOf(b), live, Select(live, step.weight, Lanes(0.0f)));
  }
  return stop_rows;
}

// Blends front to back until all pixels of the window have stopped. Calls visit(k, pixel, live,
// weight) for vectors of pixels that entry k hits, where `pixel` is the index of the first of them
// in the tile and weight = alpha_k T_k, 0 where not live. Then calls stop(k, rows) with a bit for
// each scanline in which pixels stopped before entry k.
//
// `transmittance`, [kTilePixels], is in and out. A value of 0 or less marks a pixel out of play: a
// pixel that has stopped keeps its transmittance with a negative sign.
template <class Visit, class Stop>
PEPESEG_HD void WalkTile(const TileSplats& tile, const WalkWindow& window, float* transmittance,
                         Visit&& visit, Stop&& stop) {
  bool any_live = AnyLivePixel(window, transmittance);
  for (int32_t k = 0; k < tile.count && any_live; ++k) {
    PrefetchSplat(tile, k + kPrefetchAhead);
    const Splat& splat = tile.splats[tile.entries[k]];
    const RowRange reach = RowsInReach(splat, tile.y);
    const WalkedSplat s = PrepareSplat(splat, tile.x);
    const int end = Min(reach.end, window.end_row);
    const float y_offset = tile.y + 0.5f - splat.y;
    uint32_t stop_rows = 0;
    for (int y = Max(reach.first & -kBlockRows, window.first_row); y < end; y += kBlockRows) {
      const float dy[2] = {y_offset + static_cast<float>(y),
                           y_offset + static_cast<float>(y + kBlockRows - 1)};
      for (int i = window.first_column; i < window.end_column; i += kBlockColumns) {
        stop_rows |= BlendBlock(
            s, {y, i}, dy, transmittance,
            [&](int pixel, LaneMask live, Lanes weight)
                __attribute__((always_inline)) { visit(k, pixel, live, weight); });
      }
    }
    if (HWY_UNLIKELY(stop_rows != 0)) {
      stop(k, stop_rows);
      any_live = AnyLivePixel(window, transmittance);
    }
  }
}

}  // namespace HWY_NAMESPACE
}  // namespace pepeseg
