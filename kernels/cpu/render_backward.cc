#include <algorithm>

#include "kernels/cpu/cpu_backend.h"
#include "kernels/cpu/tile_splats.h"

namespace pepeseg {
namespace {

// The tile's gradients; pixels outside the image have seen no entry.
void LoadTile(const RenderBackwardArgs& args, const TileSplats& tile, TileGrads& grads) {
  const RenderScratch& scratch = *args.scratch;
  const int64_t num_pixels = int64_t{scratch.width} * scratch.height;
  const float* r = args.color_grad.data;
  const float* g = r + num_pixels;
  const float* b = g + num_pixels;
  std::fill_n(grads.last, kTilePixels, 0.0f);
  ForEachTilePixel(tile, scratch.width, [&](int64_t in, int out) {
    grads.r[out] = r[in];
    grads.g[out] = g[in];
    grads.b[out] = b[in];
    grads.depth[out] = args.depth_grad.empty() ? 0 : args.depth_grad[in];
    const float alpha_grad = args.alpha_grad.empty() ? 0 : args.alpha_grad[in];
    grads.behind[out] = r[in] * args.background[0] + g[in] * args.background[1] +
                        b[in] * args.background[2] - alpha_grad;
    grads.transmittance[out] = scratch.pixel_transmittance.span()[in];
    grads.last[out] = static_cast<float>(scratch.pixel_last_entry.span()[in]);
  });
}

SplatGrad operator+(const SplatGrad& a, const SplatGrad& b) {
  return {a.x + b.x,
          a.y + b.y,
          a.conic_xx + b.conic_xx,
          a.conic_xy + b.conic_xy,
          a.conic_yy + b.conic_yy,
          a.opacity + b.opacity,
          a.r + b.r,
          a.g + b.g,
          a.b + b.b,
          a.depth + b.depth};
}

// Over the slots of each visible, in their order.
void SumSlots(ThreadPool& pool, RenderScratch& scratch) {
  constexpr int64_t kChunk = 2048;
  const int64_t num_visible = scratch.visible_splat.size();
  const int32_t* first_slot = scratch.visible_first_slot.span().data;
  const SplatGrad* slot_grad = scratch.slot_grad.span().data;
  SplatGrad* visible_grad = scratch.visible_grad.span().data;
  pool.ParallelFor((num_visible + kChunk - 1) / kChunk, [&](int64_t chunk, int) {
    for (int64_t i = chunk * kChunk; i < std::min(num_visible, (chunk + 1) * kChunk); ++i) {
      SplatGrad sum = {};
      for (int32_t k = first_slot[i]; k < first_slot[i + 1]; ++k) sum = sum + slot_grad[k];
      visible_grad[i] = sum;
    }
  });
}

}  // namespace

void CpuBackend::RenderBackward(const RenderBackwardArgs& args) {
  RenderScratch& scratch = *args.scratch;
  scratch.slot_grad.Reserve(*this, scratch.entry_slot.size());
  scratch.visible_grad.Reserve(*this, scratch.visible_splat.size());
  pool_.ParallelFor(NumTilesOf(scratch), [&](int64_t i, int) {
    const TileSplats tile = TileAt(scratch, i);
    TileGrads grads = {};
    LoadTile(args, tile, grads);
    const int32_t* entry_slot = scratch.entry_slot.span().data + scratch.tile_first_entry.span()[i];
    simd_.blend_tile_backward(tile, !args.depth_grad.empty(), grads, entry_slot,
                              scratch.slot_grad.span().data);
  });
  SumSlots(pool_, scratch);
}

}  // namespace pepeseg
