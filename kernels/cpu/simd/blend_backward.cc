#include "kernels/cpu/simd/kernels.h"
#include "kernels/cpu/simd/tile_walk.h"

// Backward pass of a tile. Entries are walked back to front from the last one that any pixel has
// seen. The transmittance before a splat is recovered from that after it by a division by 1 -
// alpha, which alpha <= 0.99 keeps stable. Each entry's sums over the tile go to a slot of its own.

namespace pepeseg {
namespace HWY_NAMESPACE {
namespace {

// State of the pixels of a tile, in scanlines of kTileSize pixels.
struct TileGrads {
  alignas(64) float r[kTilePixels], g[kTilePixels], b[kTilePixels], depth[kTilePixels];
  // behind_dot of math/blend.h so far: that of the colour, and that of depth and alpha.
  alignas(64) float behind[kTilePixels], shape_behind[kTilePixels];
  alignas(64) float transmittance[kTilePixels];  // after the splat that is next
  alignas(64) float last[kTilePixels];           // end of the entries seen; 0: not in play
};

// Sums over the pixels of one splat. Lanes are summed only at its end (Reduced).
struct SplatSums {
  PowerMoments<Lanes> moments;
  Lanes r, g, b, depth, squares;
};

PEPESEG_HD SplatSums ZeroSums() {
  const Lanes zero(0.0f);
  return {{zero, zero, zero, zero, zero, zero}, zero, zero, zero, zero, zero};
}

// Adds one vector of pixels with these alphas and moves their state to before the splat. Lanes that
// are not live change nothing. kWithShape: depth or alpha has a gradient.
template <bool kWithShape>
PEPESEG_HD void AddPixels(const Splat& splat, Lanes alpha, LaneMask live, Lanes dx, float dy,
                          TileGrads& pixels, int pixel, SplatSums& sums) {
  const Lanes zero(0.0f);
  const Lanes gr = Lanes::Load(pixels.r + pixel), gg = Lanes::Load(pixels.g + pixel);
  const Lanes gb = Lanes::Load(pixels.b + pixel);
  const Lanes after = Lanes::Load(pixels.transmittance + pixel);
  const Lanes before = after * FastInverse(Lanes(1.0f) - alpha);
  const Lanes behind = Lanes::Load(pixels.behind + pixel);
  const Lanes value = MulAdd(Lanes(splat.r), gr, MulAdd(Lanes(splat.g), gg, Lanes(splat.b) * gb));
  const Lanes weight = Select(live, alpha * before, zero);
  sums.r = MulAdd(weight, gr, sums.r);
  sums.g = MulAdd(weight, gg, sums.g);
  sums.b = MulAdd(weight, gb, sums.b);
  Lanes grad = Select(live, GaussianVjp(alpha, AlphaVjp(before, value, behind)), zero);
  sums.squares = MulAdd(grad, grad, sums.squares);
  if (kWithShape) {
    const Lanes gd = Lanes::Load(pixels.depth + pixel);
    sums.depth = MulAdd(weight, gd, sums.depth);
    const Lanes depth = Lanes(splat.depth) * gd;
    const Lanes shape_behind = Lanes::Load(pixels.shape_behind + pixel);
    const Lanes shape_grad = GaussianVjp(alpha, AlphaVjp(before, depth, shape_behind));
    grad = grad + Select(live, shape_grad, zero);
    Select(live, BehindStep(alpha, depth, shape_behind), shape_behind)
        .Store(pixels.shape_behind + pixel);
  }
  const Lanes grad_x = grad * dx;
  sums.moments.sum = sums.moments.sum + grad;
  sums.moments.x = sums.moments.x + grad_x;
  sums.moments.xx = MulAdd(grad_x, dx, sums.moments.xx);
  sums.moments.y = MulAdd(grad, Lanes(dy), sums.moments.y);
  sums.moments.xy = MulAdd(grad_x, Lanes(dy), sums.moments.xy);
  sums.moments.yy = MulAdd(grad, Lanes(dy * dy), sums.moments.yy);
  Select(live, before, after).Store(pixels.transmittance + pixel);
  Select(live, BehindStep(alpha, value, behind), behind).Store(pixels.behind + pixel);
}

// Adds one entry at the two vectors of a block. Returns whether it was blended at any pixel.
template <bool kWithShape>
PEPESEG_HD bool AddBlock(const Splat& splat, const WalkedSplat& s, Lanes index, const Block& block,
                         const float* dy, TileGrads& pixels, SplatSums& sums) {
  Lanes power[2], alpha[2];
  LaneMask live[2];
  for (int b = 0; b < 2; ++b) {
    power[b] = PowerOf(s, dy[b], s.dx[block.ColumnOf(b)]);
    live[b] = (s.min_power <= power[b]) & (index < Lanes::Load(pixels.last + block.PixelOf(b)));
  }
  if (None(live[0] | live[1])) return false;
  for (int b = 0; b < 2; ++b) alpha[b] = Alpha(s.opacity, Exp2(power[b]));
  for (int b = 0; b < 2; ++b) {
    AddPixels<kWithShape>(splat, alpha[b], live[b], s.dx[block.ColumnOf(b)], dy[b], pixels,
                          block.PixelOf(b), sums);
  }
  return true;
}

// Sums the lanes and turns the moments into gradients of the splat.
PEPESEG_HD SplatGrad Reduced(const Splat& splat, const SplatSums& s) {
  float sums[12];
  StoreSums(s.moments.sum, s.moments.x, s.moments.y, s.moments.xx, sums);
  StoreSums(s.moments.xy, s.moments.yy, s.r, s.g, sums + 4);
  StoreSums(s.b, s.depth, s.squares, s.squares, sums + 8);
  const PowerMoments<float> moments = {sums[0], sums[1], sums[2], sums[3], sums[4], sums[5]};
  const PowerRoot<float> root = {splat.root_xx, splat.root_xy, splat.root_yy};
  const auto shape = SplatShapeVjp(root, splat.opacity, moments);
  return {shape.x, shape.y, shape.conic_xx, shape.conic_xy, shape.conic_yy, shape.opacity,
          sums[6], sums[7], sums[8],        sums[9],        sums[10]};
}

// Loads the tile's part of the gradients. Pixels outside the image, and those with gradients of
// zero only (such as ignored ones), count as having seen no entry. Returns the end of the entries
// that any other pixel has seen.
PEPESEG_HD int32_t LoadTile(const TileSplats& tile, const ImageGrads& image, TileGrads& out) {
  float most = 0;
  const int64_t corner = static_cast<int64_t>(tile.y) * image.stride + static_cast<int64_t>(tile.x);
  for (int pixel = 0; pixel < kTilePixels; pixel += kLanes) {
    const int x = pixel % kTileSize, y = pixel / kTileSize;
    const int count = y < tile.height ? Min(kLanes, Max(0, tile.width - x)) : 0;
    const int64_t at = corner + y * image.stride + x;
    const auto load = [&](const float* plane) __attribute__((always_inline)) {
      return plane == nullptr || count == 0 ? Lanes(0.0f) : LoadSome(plane + at, count);
    };
    const Lanes r = load(image.r), g = load(image.g), b = load(image.b);
    r.Store(out.r + pixel);
    g.Store(out.g + pixel);
    b.Store(out.b + pixel);
    const Lanes depth = load(image.depth), alpha = load(image.alpha);
    depth.Store(out.depth + pixel);
    float alpha_grad[kLanes];
    alpha.Store(alpha_grad);
    load(image.transmittance).Store(out.transmittance + pixel);
    Lanes(0.0f).Store(out.behind + pixel);
    (Lanes(0.0f) - alpha).Store(out.shape_behind + pixel);
    for (int i = 0; i < kLanes; ++i) {
      const int at_lane = pixel + i;
      const bool any = out.r[at_lane] != 0 || out.g[at_lane] != 0 || out.b[at_lane] != 0 ||
                       out.depth[at_lane] != 0 || alpha_grad[i] != 0;
      const float last = i < count && any ? static_cast<float>(image.last[at + i]) : 0.0f;
      out.last[pixel + i] = last;
      most = Max(most, last);
    }
  }
  return static_cast<int32_t>(most);
}

// Walks the entries before num_blended back to front and writes the slots of all entries; those of
// entries that no pixel has blended are zero.
template <bool kWithShape>
PEPESEG_HD void WalkBack(const TileSplats& tile, int32_t num_blended, TileGrads& pixels,
                         SplatGrad* slot_grad) {
  const int32_t* const entry_slot = tile.entry_slot;
  for (int32_t k = num_blended; k < tile.count; ++k) slot_grad[entry_slot[k]] = {};
  for (int32_t k = num_blended; k-- > 0;) {
    PrefetchSplat(tile, k - kPrefetchAhead);
    if (k >= kPrefetchAhead) __builtin_prefetch(slot_grad + entry_slot[k - kPrefetchAhead], 1);
    const Splat& splat = tile.splats[tile.entries[k]];
    const RowRange reach = RowsInReach(splat, tile.y);
    const WalkedSplat s = PrepareSplat(splat, tile.x);
    const Lanes index(static_cast<float>(k));
    SplatSums sums = ZeroSums();
    bool touched = false;
    const float y_offset = tile.y + 0.5f - splat.y;
    for (int y = reach.first & -kBlockRows; y < reach.end; y += kBlockRows) {
      const float dy[2] = {y_offset + static_cast<float>(y),
                           y_offset + static_cast<float>(y + kBlockRows - 1)};
      for (int i = 0; i < kVectorsPerRow; i += kBlockColumns) {
        touched |= AddBlock<kWithShape>(splat, s, index, {y, i}, dy, pixels, sums);
      }
    }
    slot_grad[entry_slot[k]] = touched ? Reduced(splat, sums) : SplatGrad{};
  }
}

}  // namespace

void BlendTileBackward(const TileSplats& tile, const ImageGrads& image, SplatGrad* slot_grad) {
  TileGrads pixels;
  const int32_t num_blended = LoadTile(tile, image, pixels);
  image.depth != nullptr || image.alpha != nullptr
      ? WalkBack<true>(tile, num_blended, pixels, slot_grad)
      : WalkBack<false>(tile, num_blended, pixels, slot_grad);
}

}  // namespace HWY_NAMESPACE
}  // namespace pepeseg
