#pragma once

#include "kernels/cpu/tile_cover.h"
#include "kernels/render_scratch.h"

namespace pepeseg {

// Calls fn(visible, weight) for the splats blended at a pixel, front to back, with weight a_i T_i:
// the same thresholds as the render that filled the scratch.
template <class Fn>
inline void ForEachBlended(const RenderScratch& scratch, int32_t pixel, Fn&& fn) {
  const int x = pixel % scratch.width, y = pixel / scratch.width;
  const int tile = y / kTileSize * scratch.num_tiles_x + x / kTileSize;
  const int32_t first = scratch.tile_first_entry.span()[tile];
  const int32_t end = first + scratch.pixel_last_entry.span()[pixel];
  float transmittance = 1;
  for (int32_t entry = first; entry < end; ++entry) {
    const int32_t visible = scratch.entry_visible.span()[entry];
    const Splat& s = scratch.visible_splat.span()[visible];
    const float dx = x + 0.5f - s.x, dy = y + 0.5f - s.y;
    const PowerRoot<float> root = {s.root_xx, s.root_xy, s.root_yy};
    const float power = Power(root, PowerAtRow(root, dy), dx);
    if (power < s.min_power) continue;
    const float alpha = Alpha(s.opacity, Exp2(power));
    fn(visible, alpha * transmittance);
    transmittance *= 1 - alpha;
  }
}

}  // namespace pepeseg
