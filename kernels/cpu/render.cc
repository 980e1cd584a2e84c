#include <algorithm>

#include "kernels/cpu/cpu_backend.h"
#include "kernels/cpu/project.h"
#include "kernels/cpu/splat_order.h"
#include "kernels/math/blend.h"

namespace pepeseg {
namespace {

void BlendPixel(const RenderArgs& args, int tile, int x, int y) {
  RenderScratch& scratch = *args.scratch;
  const int64_t pixel = int64_t{y} * scratch.width + x;
  const int64_t num_pixels = int64_t{scratch.width} * scratch.height;
  const int32_t first = scratch.tile_first_entry.span()[tile];
  const int32_t end = scratch.tile_first_entry.span()[tile + 1];
  float transmittance = 1, r = 0, g = 0, b = 0, depth = 0;
  int32_t last = 0;
  for (int32_t entry = first; entry < end; ++entry) {
    const Splat& s = scratch.visible_splat.span()[scratch.entry_visible.span()[entry]];
    const float dx = x + 0.5f - s.x, dy = y + 0.5f - s.y;
    const PowerRoot<float> root = {s.root_xx, s.root_xy, s.root_yy};
    const float power = Power(root, PowerAtRow(root, dy), dx);
    if (power < s.min_power) continue;
    const float alpha = Alpha(s.opacity, Exp2(power));
    const float next = transmittance * (1 - alpha);
    if (next < kMinTransmittance) break;
    const float weight = alpha * transmittance;
    r += weight * s.r;
    g += weight * s.g;
    b += weight * s.b;
    depth += weight * s.depth;
    transmittance = next;
    last = entry + 1 - first;
  }
  args.color[pixel] = r + transmittance * args.background[0];
  args.color[num_pixels + pixel] = g + transmittance * args.background[1];
  args.color[2 * num_pixels + pixel] = b + transmittance * args.background[2];
  if (!args.alpha.empty()) args.alpha[pixel] = 1 - transmittance;
  if (!args.depth.empty()) args.depth[pixel] = depth;
  scratch.pixel_transmittance.span()[pixel] = transmittance;
  scratch.pixel_last_entry.span()[pixel] = last;
}

}  // namespace

void CpuBackend::Render(const RenderArgs& args) {
  RenderScratch& scratch = *args.scratch;
  scratch.width = args.view.width;
  scratch.height = args.view.height;
  scratch.num_tiles_x = (args.view.width + kTileSize - 1) / kTileSize;
  scratch.num_tiles_y = (args.view.height + kTileSize - 1) / kTileSize;
  scratch.counters.Reserve(*this, kNumRenderCounters);
  scratch.counters.Zero();
  const int64_t num_pixels = int64_t{scratch.width} * scratch.height;
  scratch.pixel_transmittance.Reserve(*this, num_pixels);
  scratch.pixel_last_entry.Reserve(*this, num_pixels);

  ProjectGaussians(*this, pool_, args);
  ListTileEntries(*this, pool_, scratch);
  pool_.ParallelFor(int64_t{scratch.num_tiles_x} * scratch.num_tiles_y, [&](int64_t tile, int) {
    const int first_x = static_cast<int>(tile % scratch.num_tiles_x) * kTileSize;
    const int first_y = static_cast<int>(tile / scratch.num_tiles_x) * kTileSize;
    for (int y = first_y; y < std::min(scratch.height, first_y + kTileSize); ++y) {
      for (int x = first_x; x < std::min(scratch.width, first_x + kTileSize); ++x) {
        BlendPixel(args, static_cast<int>(tile), x, y);
      }
    }
  });
}

}  // namespace pepeseg
