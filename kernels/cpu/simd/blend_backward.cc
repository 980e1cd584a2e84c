#include "kernels/cpu/simd/kernels.h"
#include "kernels/cpu/simd/tile_walk.h"

namespace pepeseg {
namespace HWY_NAMESPACE {
namespace {

// Sums over the pixels of one splat, a lane for each column of pixels.
struct SplatSums {
  PowerMoments<Lanes> moments;
  Lanes r, g, b, depth;
};

PEPESEG_HD SplatSums ZeroSums() {
  const Lanes zero(0.0f);
  return {{zero, zero, zero, zero, zero, zero}, zero, zero, zero, zero};
}

template <bool kWithDepth>
PEPESEG_HD void AddPixels(const Splat& splat, const WalkedSplat& s, Lanes power, LaneMask live,
                          TileGrads& pixels, int pixel, Lanes dx, float dy, SplatSums& sums) {
  const Lanes zero(0.0f);
  const Lanes gr = Lanes::Load(pixels.r + pixel), gg = Lanes::Load(pixels.g + pixel);
  const Lanes gb = Lanes::Load(pixels.b + pixel);
  const Lanes alpha = Alpha(s.opacity, Exp2(power));
  const Lanes after = Lanes::Load(pixels.transmittance + pixel);
  const Lanes before = after * FastInverse(Lanes(1.0f) - alpha);
  const Lanes behind = Lanes::Load(pixels.behind + pixel);
  Lanes value = MulAdd(Lanes(splat.r), gr, MulAdd(Lanes(splat.g), gg, Lanes(splat.b) * gb));
  const Lanes weight = Select(live, alpha * before, zero);
  sums.r = MulAdd(weight, gr, sums.r);
  sums.g = MulAdd(weight, gg, sums.g);
  sums.b = MulAdd(weight, gb, sums.b);
  if (kWithDepth) {
    const Lanes gd = Lanes::Load(pixels.depth + pixel);
    value = MulAdd(Lanes(splat.depth), gd, value);
    sums.depth = MulAdd(weight, gd, sums.depth);
  }
  const Lanes all = GaussianVjp(alpha, AlphaVjp(before, value, behind));
  const Lanes grad = Select(live, all, zero), grad_x = grad * dx;
  sums.moments.sum = sums.moments.sum + grad;
  sums.moments.x = sums.moments.x + grad_x;
  sums.moments.xx = MulAdd(grad_x, dx, sums.moments.xx);
  sums.moments.y = MulAdd(grad, Lanes(dy), sums.moments.y);
  sums.moments.xy = MulAdd(grad_x, Lanes(dy), sums.moments.xy);
  sums.moments.yy = MulAdd(grad, Lanes(dy * dy), sums.moments.yy);
  Select(live, before, after).Store(pixels.transmittance + pixel);
  Select(live, BehindStep(alpha, value, behind), behind).Store(pixels.behind + pixel);
}

PEPESEG_HD SplatGrad Reduced(const Splat& splat, const SplatSums& s) {
  const PowerMoments<float> moments = {Sum(s.moments.sum), Sum(s.moments.x),  Sum(s.moments.y),
                                       Sum(s.moments.xx),  Sum(s.moments.xy), Sum(s.moments.yy)};
  const PowerRoot<float> root = {splat.root_xx, splat.root_xy, splat.root_yy};
  const auto shape = SplatShapeVjp(root, splat.opacity, moments);
  return {shape.x,       shape.y,  shape.conic_xx, shape.conic_xy, shape.conic_yy,
          shape.opacity, Sum(s.r), Sum(s.g),       Sum(s.b),       Sum(s.depth)};
}

template <bool kWithDepth>
PEPESEG_HD void WalkBack(const TileSplats& tile, TileGrads& pixels, const int32_t* entry_slot,
                         SplatGrad* slot_grad) {
  float max_last = 0;
  for (int i = 0; i < kTilePixels; ++i) max_last = Max(max_last, pixels.last[i]);
  const auto num_blended = static_cast<int32_t>(max_last);
  for (int32_t k = num_blended; k < tile.count; ++k) slot_grad[entry_slot[k]] = {};
  for (int32_t k = num_blended; k-- > 0;) {
    const Splat& splat = tile.splats[tile.entries[k]];
    const RowRange reach = RowsInReach(splat, tile.y);
    const WalkedSplat s = PrepareSplat(splat, tile.x);
    const Lanes index(static_cast<float>(k));
    SplatSums sums = ZeroSums();
    bool touched = false;
    for (int y = reach.first; y < reach.end; ++y) {
      const float dy = tile.y + static_cast<float>(y) + 0.5f - splat.y;
      const auto row = PowerAtRow(s.root, dy);
      for (int i = 0; i < kVectorsPerRow; ++i) {
        const int pixel = y * kTileSize + i * kLanes;
        const Lanes power = PowerOf(s, row, i);
        const LaneMask live = (s.min_power <= power) & (index < Lanes::Load(pixels.last + pixel));
        if (None(live)) continue;
        AddPixels<kWithDepth>(splat, s, power, live, pixels, pixel, s.dx[i], dy, sums);
        touched = true;
      }
    }
    slot_grad[entry_slot[k]] = touched ? Reduced(splat, sums) : SplatGrad{};
  }
}

}  // namespace

void BlendTileBackward(const TileSplats& tile, bool with_depth, TileGrads& pixels,
                       const int32_t* entry_slot, SplatGrad* slot_grad) {
  with_depth ? WalkBack<true>(tile, pixels, entry_slot, slot_grad)
             : WalkBack<false>(tile, pixels, entry_slot, slot_grad);
}

}  // namespace HWY_NAMESPACE
}  // namespace pepeseg
