#include <algorithm>

#include "kernels/cpu/cpu_backend.h"
#include "kernels/math/blend.h"

namespace pepeseg {
namespace {

// One pixel's part: from the last splat that was blended back to the first, adding to the slot of
// each (the tile's own, so no two threads meet).
void BackwardPixel(const RenderBackwardArgs& args, int32_t first_entry, int x, int y) {
  RenderScratch& scratch = *args.scratch;
  const int64_t pixel = int64_t{y} * scratch.width + x;
  const int64_t num_pixels = int64_t{scratch.width} * scratch.height;
  const float gr = args.color_grad[pixel], gg = args.color_grad[num_pixels + pixel];
  const float gb = args.color_grad[2 * num_pixels + pixel];
  const float gd = args.depth_grad.empty() ? 0 : args.depth_grad[pixel];
  const float ga = args.alpha_grad.empty() ? 0 : args.alpha_grad[pixel];
  float behind = gr * args.background[0] + gg * args.background[1] + gb * args.background[2] - ga;
  float transmittance = scratch.pixel_transmittance.span()[pixel];
  for (int32_t k = scratch.pixel_last_entry.span()[pixel]; k-- > 0;) {
    const int32_t entry = first_entry + k;
    const Splat& s = scratch.visible_splat.span()[scratch.entry_visible.span()[entry]];
    const float dx = x + 0.5f - s.x, dy = y + 0.5f - s.y;
    const PowerRoot<float> root = {s.root_xx, s.root_xy, s.root_yy};
    const float power = Power(root, PowerAtRow(root, dy), dx);
    if (power < s.min_power) continue;
    const float alpha = Alpha(s.opacity, Exp2(power));
    transmittance /= 1 - alpha;
    const float value = s.r * gr + s.g * gg + s.b * gb + s.depth * gd;
    const float power_grad = GaussianVjp(alpha, AlphaVjp(transmittance, value, behind));
    behind = BehindStep(alpha, value, behind);
    const float weight = alpha * transmittance;
    const PowerMoments<float> moments = {power_grad,           power_grad * dx,
                                         power_grad * dy,      power_grad * dx * dx,
                                         power_grad * dx * dy, power_grad * dy * dy};
    const auto shape = SplatShapeVjp(root, s.opacity, moments);
    SplatGrad& out = scratch.slot_grad.span()[scratch.entry_slot.span()[entry]];
    out.x += shape.x;
    out.y += shape.y;
    out.conic_xx += shape.conic_xx;
    out.conic_xy += shape.conic_xy;
    out.conic_yy += shape.conic_yy;
    out.opacity += shape.opacity;
    out.r += weight * gr;
    out.g += weight * gg;
    out.b += weight * gb;
    out.depth += weight * gd;
  }
}

SplatGrad Sum(const SplatGrad* grads, int64_t count) {
  SplatGrad sum = {};
  for (int64_t i = 0; i < count; ++i) {
    const SplatGrad& g = grads[i];
    sum = {sum.x + g.x,
           sum.y + g.y,
           sum.conic_xx + g.conic_xx,
           sum.conic_xy + g.conic_xy,
           sum.conic_yy + g.conic_yy,
           sum.opacity + g.opacity,
           sum.r + g.r,
           sum.g + g.g,
           sum.b + g.b,
           sum.depth + g.depth};
  }
  return sum;
}

}  // namespace

void CpuBackend::RenderBackward(const RenderBackwardArgs& args) {
  RenderScratch& scratch = *args.scratch;
  scratch.slot_grad.Reserve(*this, scratch.entry_slot.size());
  scratch.slot_grad.Zero();
  scratch.visible_grad.Reserve(*this, scratch.visible_splat.size());
  pool_.ParallelFor(int64_t{scratch.num_tiles_x} * scratch.num_tiles_y, [&](int64_t tile, int) {
    const int first_x = static_cast<int>(tile % scratch.num_tiles_x) * kTileSize;
    const int first_y = static_cast<int>(tile / scratch.num_tiles_x) * kTileSize;
    const int32_t first_entry = scratch.tile_first_entry.span()[tile];
    for (int y = first_y; y < std::min(scratch.height, first_y + kTileSize); ++y) {
      for (int x = first_x; x < std::min(scratch.width, first_x + kTileSize); ++x) {
        BackwardPixel(args, first_entry, x, y);
      }
    }
  });

  constexpr int64_t kChunk = 2048;
  const int64_t num_visible = scratch.visible_splat.size();
  const int32_t* first_slot = scratch.visible_first_slot.span().data;
  pool_.ParallelFor((num_visible + kChunk - 1) / kChunk, [&](int64_t chunk, int) {
    for (int64_t i = chunk * kChunk; i < std::min(num_visible, (chunk + 1) * kChunk); ++i) {
      scratch.visible_grad.span()[i] =
          Sum(scratch.slot_grad.span().data + first_slot[i], first_slot[i + 1] - first_slot[i]);
    }
  });
}

}  // namespace pepeseg
