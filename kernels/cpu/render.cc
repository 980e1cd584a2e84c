#include <string>

#include "kernels/cpu/cpu_backend.h"
#include "kernels/cpu/project.h"
#include "kernels/cpu/splat_order.h"
#include "kernels/cpu/tile_splats.h"

namespace pepeseg {
// Projects the Gaussians, lists their entries by tile and depth, then blends the tiles in parallel.
// Each pixel is blended by one task, front to back.
void CpuBackend::Render(const RenderArgs& args) {
  if (failed()) return;
  RenderScratch& scratch = *args.scratch;
  scratch.width = args.view.width;
  scratch.height = args.view.height;
  scratch.num_tiles_x = (args.view.width + kTileSize - 1) / kTileSize;
  scratch.num_tiles_y = (args.view.height + kTileSize - 1) / kTileSize;
  scratch.inverse_depth = args.inverse_depth;
  scratch.for_backward = args.for_backward;
  const int64_t num_pixels = int64_t{scratch.width} * scratch.height;
  if (!scratch.counters.Reserve(*this, kNumRenderCounters) ||
      !scratch.pixel_transmittance.Reserve(*this, num_pixels) ||
      !scratch.pixel_last_entry.Reserve(*this, num_pixels)) {
    return;
  }
  scratch.counters.Zero();
  ProjectGaussians(*this, pool_, simd_, args);
  if (failed()) return;
  if (const int64_t num_entries = scratch.counters.span()[kNumTileEntries];
      num_entries > kMaxTileEntries) {
    return Fail({"render: " + std::to_string(num_entries) +
                 " pairs of Gaussian and tile, at most " + std::to_string(kMaxTileEntries) +
                 " are possible"});
  }
  ListTileEntries(*this, scratch);
  if (failed()) return;
  ImageColors image = {};
  // Alpha and depth are written unless their pointers are null.
  image.stride = scratch.width;
  image.r = args.color.data;
  image.g = image.r + num_pixels;
  image.b = image.g + num_pixels;
  image.alpha = args.alpha.data;
  image.depth = args.depth.data;
  image.transmittance = scratch.pixel_transmittance.span().data;
  image.last = scratch.pixel_last_entry.span().data;
  pool_.ParallelFor(NumTilesOf(scratch),
                    [&](int64_t i, int) { simd_.blend_tile(TileAt(scratch, i), image); });
}

}  // namespace pepeseg
