#pragma once

#include "kernels/cpu/simd/lanes.h"
#include "kernels/cpu/simd_kernels.h"
#include "kernels/math/blend.h"

namespace pepeseg {
namespace HWY_NAMESPACE {

inline constexpr int kVectorsPerRow = 16 / kLanes;

// Rows of the tile that a splat can reach.
struct RowRange {
  int first, end;
};
PEPESEG_HD RowRange RowsInReach(const Splat& s, float tile_y) {
  const float center = s.y - tile_y - 0.5f;
  // Beyond the tile on either side before the conversion: the values may be huge.
  const float first = Min(Max(center - s.half_height, -0.5f), 16.0f);
  const float end = Min(Max(center + s.half_height, -1.0f), 15.0f);
  const int first_row = static_cast<int>(first);
  return {first_row + (static_cast<float>(first_row) < first), static_cast<int>(end + 1.0f)};
}

// A splat as the loop over its pixels wants it.
struct WalkedSplat {
  PowerRoot<float> root;
  Lanes root_xx, min_power, opacity;
  Lanes dx[kVectorsPerRow];
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
PEPESEG_HD Lanes PowerOf(const WalkedSplat& s, const PowerRow<float>& row, int i) {
  return Power(s.root_xx, PowerRow<Lanes>{Lanes(row.shift), Lanes(row.drop)}, s.dx[i]);
}

// The pixels that a walk visits, within the tile.
struct WalkWindow {
  int first_row, end_row;
  int first_vector, end_vector;
};

PEPESEG_HD bool AnyLivePixel(const WalkWindow& window, const float* transmittance) {
  Lanes most(0.0f);
  for (int y = window.first_row; y < window.end_row; ++y) {
    for (int i = window.first_vector; i < window.end_vector; ++i) {
      most = Max(most, Lanes::Load(transmittance + y * kTileSize + i * kLanes));
    }
  }
  return !None(Lanes(0.0f) < most);
}

// Blends front to back: calls visit(k, pixel, live, weight) for vectors of pixels that entry k
// hits, `pixel` the index of the first of them in the tile, weight = a_i T_i and 0 where not live;
// then stop(k, rows) with a bit for each row in which pixels ended before entry k. A transmittance
// of 0 or less marks a pixel out of play: one that has stopped keeps its own, negative.
template <class Visit, class Stop>
PEPESEG_HD void WalkTile(const TileSplats& tile, const WalkWindow& window, float* transmittance,
                         Visit&& visit, Stop&& stop) {
  bool any_live = AnyLivePixel(window, transmittance);
  for (int32_t k = 0; k < tile.count && any_live; ++k) {
    const Splat& splat = tile.splats[tile.entries[k]];
    const RowRange reach = RowsInReach(splat, tile.y);
    const WalkedSplat s = PrepareSplat(splat, tile.x);
    const int end = Min(reach.end, window.end_row);
    uint32_t stop_rows = 0;
    for (int y = Max(reach.first, window.first_row); y < end; ++y) {
      const auto row = PowerAtRow(s.root, tile.y + static_cast<float>(y) + 0.5f - splat.y);
      for (int i = window.first_vector; i < window.end_vector; ++i) {
        const int pixel = y * kTileSize + i * kLanes;
        const Lanes power = PowerOf(s, row, i);
        const Lanes before = Lanes::Load(transmittance + pixel);
        const LaneMask hit = (s.min_power <= power) & (Lanes(0.0f) < before);
        if (None(hit)) continue;
        const Blended<Lanes> step = BlendStep(Alpha(s.opacity, Exp2(power)), before);
        const LaneMask stops = hit & (step.transmittance < Lanes(kMinTransmittance));
        const LaneMask live = AndNot(stops, hit);
        stop_rows |= static_cast<uint32_t>(!None(stops)) << y;
        const Lanes kept = Select(stops, Lanes(0.0f) - before, before);
        Select(live, step.transmittance, kept).Store(transmittance + pixel);
        visit(k, pixel, live, Select(live, step.weight, Lanes(0.0f)));
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
