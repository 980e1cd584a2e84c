#include <algorithm>
#include <cassert>
#include <vector>

#include "kernels/cpu/cpu_backend.h"
#include "kernels/cpu/tile_splats.h"
#include "kernels/math/blend.h"

namespace pepeseg {
namespace {

constexpr int64_t kChunk = 16;  // pixels a task

struct PixelRow {
  TileSplats tile;
  std::vector<float> weights;  // of the tile's first entries
};

// The entries after the last one that was blended are not looked at.
PixelRow WeightsAt(const SimdKernels& simd, const RenderScratch& scratch, int32_t pixel) {
  const int x = pixel % scratch.width, y = pixel / scratch.width;
  PixelRow row = {TileAt(scratch, y / kTileSize * scratch.num_tiles_x + x / kTileSize), {}};
  row.tile.count = scratch.pixel_last_entry.span()[pixel];
  row.weights.resize(row.tile.count);
  simd.pixel_weights(row.tile, x % kTileSize, y % kTileSize, row.weights.data());
  return row;
}

}  // namespace

void CpuBackend::CaptureRows(const CaptureRowsArgs& args) {
  if (failed()) return;
  const RenderScratch& scratch = *args.scratch;
  const int64_t num_pixels = args.pixels.size;
  if (!args.row_first->Reserve(*this, num_pixels + 1)) return;
  int32_t* row_first = args.row_first->span().data;
  assert(row_first != nullptr);
  row_first[0] = 0;
  std::vector<PixelRow> rows(num_pixels);
  pool_.ParallelFor((num_pixels + kChunk - 1) / kChunk, [&](int64_t chunk, int) {
    for (int64_t i = chunk * kChunk; i < std::min(num_pixels, (chunk + 1) * kChunk); ++i) {
      rows[i] = WeightsAt(simd_, scratch, args.pixels[i]);
      row_first[i + 1] = static_cast<int32_t>(std::count_if(
          rows[i].weights.begin(), rows[i].weights.end(), [](float w) { return w > 0; }));
    }
  });
  for (int64_t i = 0; i < num_pixels; ++i) row_first[i + 1] += row_first[i];

  if (!args.entry_gaussian->Reserve(*this, row_first[num_pixels]) ||
      !args.entry_weight->Reserve(*this, row_first[num_pixels])) {
    return;
  }
  const int32_t* gaussians = scratch.visible_gaussian.span().data;
  for (int64_t i = 0; i < num_pixels; ++i) {
    const TileSplats& tile = rows[i].tile;
    int32_t* gaussian = args.entry_gaussian->span().data + row_first[i];
    float* weight = args.entry_weight->span().data + row_first[i];
    float alpha = 0, depth = 0;
    for (int32_t k = 0; k < tile.count; ++k) {
      const float w = rows[i].weights[k];
      if (!(w > 0)) continue;
      *gaussian++ = gaussians[tile.entries[k]];
      *weight++ = w;
      alpha += w;
      const float blended = tile.splats[tile.entries[k]].depth;
      depth += w * (scratch.inverse_depth ? InverseDepth(blended) : blended);
    }
    if (!args.pixel_alpha.empty()) args.pixel_alpha[i] = alpha;
    if (!args.pixel_depth.empty()) args.pixel_depth[i] = depth;
  }
}

}  // namespace pepeseg
