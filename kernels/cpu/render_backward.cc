#include <algorithm>

#include "kernels/cpu/cpu_backend.h"
#include "kernels/cpu/tile_splats.h"
#include "kernels/math/blend.h"

namespace pepeseg {
namespace {

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
          a.depth + b.depth,
          a.squares + b.squares};
}

// Sums the slots of each visible Gaussian in their order, so that the sum does not depend on which
// tile was done first. Turns the gradient of an inverse depth into that of z.
void SumSlots(ThreadPool& pool, RenderScratch& scratch) {
  constexpr int64_t kChunk = 2048;
  const int64_t num_visible = scratch.visible_splat.size();
  const int32_t* first_slot = scratch.visible_first_slot.span().data;
  const SplatGrad* slot_grad = scratch.slot_grad.span().data;
  SplatGrad* visible_grad = scratch.visible_grad.span().data;
  const Splat* splats = scratch.visible_splat.span().data;
  pool.ParallelFor((num_visible + kChunk - 1) / kChunk, [&](int64_t chunk, int) {
    for (int64_t i = chunk * kChunk; i < std::min(num_visible, (chunk + 1) * kChunk); ++i) {
      SplatGrad sum = {};
      for (int32_t k = first_slot[i]; k < first_slot[i + 1]; ++k) sum = sum + slot_grad[k];
      if (scratch.inverse_depth) sum.depth = InverseDepthVjp(splats[i].depth, sum.depth);
      visible_grad[i] = sum;
    }
  });
}

}  // namespace

// Tiles run in parallel; each writes the slots of its own entries.
void CpuBackend::RenderBackward(const RenderBackwardArgs& args) {
  if (failed()) return;
  RenderScratch& scratch = *args.scratch;
  if (!scratch.for_backward)
    return Fail({"RenderBackward: the render was not made for it", /*fatal=*/true});
  if (!scratch.slot_grad.Reserve(*this, scratch.entry_slot.size()) ||
      !scratch.visible_grad.Reserve(*this, scratch.visible_splat.size())) {
    return;
  }
  const int64_t num_pixels = int64_t{scratch.width} * scratch.height;
  ImageGrads image = {};
  image.stride = scratch.width;
  image.r = args.color_grad.data;
  image.g = image.r + num_pixels;
  image.b = image.g + num_pixels;
  image.alpha = args.alpha_grad.empty() ? nullptr : args.alpha_grad.data;
  image.depth = args.depth_grad.empty() ? nullptr : args.depth_grad.data;
  image.transmittance = scratch.pixel_transmittance.span().data;
  image.last = scratch.pixel_last_entry.span().data;
  image.entry_blocks = scratch.entry_blocks.span().data;
  SplatGrad* slot_grad = scratch.slot_grad.span().data;
  pool_.ParallelFor(NumTilesOf(scratch), [&](int64_t i, int) {
    simd_.blend_tile_backward(TileAt(scratch, i), image, slot_grad);
  });
  SumSlots(pool_, scratch);
}

}  // namespace pepeseg
