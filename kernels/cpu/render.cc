#include "kernels/cpu/cpu_backend.h"
#include "kernels/cpu/project.h"
#include "kernels/cpu/splat_order.h"
#include "kernels/cpu/tile_splats.h"

namespace pepeseg {
namespace {

void StoreTile(const RenderArgs& args, const TileSplats& tile, const TileColors& colors) {
  RenderScratch& scratch = *args.scratch;
  const int64_t num_pixels = int64_t{scratch.width} * scratch.height;
  float* r = args.color.data;
  float* g = r + num_pixels;
  float* b = g + num_pixels;
  ForEachTilePixel(tile, scratch.width, [&](int64_t out, int in) {
    const float transmittance = colors.transmittance[in];
    r[out] = colors.r[in] + transmittance * args.background[0];
    g[out] = colors.g[in] + transmittance * args.background[1];
    b[out] = colors.b[in] + transmittance * args.background[2];
    scratch.pixel_transmittance.span()[out] = transmittance;
    scratch.pixel_last_entry.span()[out] = static_cast<int32_t>(colors.last[in]);
    if (!args.alpha.empty()) args.alpha[out] = 1 - transmittance;
    if (!args.depth.empty()) args.depth[out] = colors.depth[in];
  });
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

  ProjectGaussians(*this, pool_, simd_, args);
  ListTileEntries(*this, pool_, scratch);
  pool_.ParallelFor(NumTilesOf(scratch), [&](int64_t i, int) {
    const TileSplats tile = TileAt(scratch, i);
    TileColors colors;
    simd_.blend_tile(tile, !args.depth.empty(), colors);
    StoreTile(args, tile, colors);
  });
}

}  // namespace pepeseg
