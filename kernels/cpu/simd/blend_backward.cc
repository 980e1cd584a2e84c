#include "kernels/cpu/simd/kernels.h"
#include "kernels/cpu/simd/tile_walk.h"

// Backward pass of a tile. Entries are walked back to front from the last one that any pixel has
// seen. The transmittance before a splat is recovered from that after it by a division by 1 -
// alpha, which alpha <= 0.99 keeps stable. An entry is evaluated in the blocks in which the forward
// pass blended it, and its sums over the tile go to a slot of its own.

namespace pepeseg {
namespace HWY_NAMESPACE {
namespace {

// State of the pixels of a tile, in the order of TilePixel.
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

// The values of a splat that are blended.
struct SplatColor {
  Lanes r, g, b, depth;
};

// Adds one vector of pixels with these alphas and moves their state to before the splat. Lanes that
// are not live change nothing. kWithShape: depth or alpha has a gradient.
template <bool kWithShape>
PEPESEG_HD void AddPixels(const SplatColor& splat, Lanes alpha, LaneMask live, const Offsets& at,
                          TileGrads& pixels, int pixel, SplatSums& sums) {
  const Lanes zero(0.0f);
  const Lanes gr = Lanes::Load(pixels.r + pixel), gg = Lanes::Load(pixels.g + pixel);
  const Lanes gb = Lanes::Load(pixels.b + pixel);
  const Lanes after = Lanes::Load(pixels.transmittance + pixel);
  const Lanes before = after * FastInverse(Lanes(1.0f) - alpha);
  const Lanes behind = Lanes::Load(pixels.behind + pixel);
  const Lanes value = MulAdd(splat.r, gr, MulAdd(splat.g, gg, splat.b * gb));
  const Lanes weight = Select(live, alpha * before, zero);
  sums.r = MulAdd(weight, gr, sums.r);
  sums.g = MulAdd(weight, gg, sums.g);
  sums.b = MulAdd(weight, gb, sums.b);
  Lanes grad = Select(live, GaussianVjp(alpha, AlphaVjp(before, value, behind)), zero);
  sums.squares = MulAdd(grad, grad, sums.squares);
  if (kWithShape) {
    const Lanes gd = Lanes::Load(pixels.depth + pixel);
    sums.depth = MulAdd(weight, gd, sums.depth);
    const Lanes depth = splat.depth * gd;
    const Lanes shape_behind = Lanes::Load(pixels.shape_behind + pixel);
    const Lanes shape_grad = GaussianVjp(alpha, AlphaVjp(before, depth, shape_behind));
    grad = grad + Select(live, shape_grad, zero);
    Select(live, BehindStep(alpha, depth, shape_behind), shape_behind)
        .Store(pixels.shape_behind + pixel);
  }
  const Lanes grad_x = grad * at.dx, grad_y = grad * at.dy;
  sums.moments.sum = sums.moments.sum + grad;
  sums.moments.x = sums.moments.x + grad_x;
  sums.moments.xx = MulAdd(grad_x, at.dx, sums.moments.xx);
  sums.moments.y = sums.moments.y + grad_y;
  sums.moments.xy = MulAdd(grad_x, at.dy, sums.moments.xy);
  sums.moments.yy = MulAdd(grad_y, at.dy, sums.moments.yy);
  Select(live, before, after).Store(pixels.transmittance + pixel);
  Select(live, BehindStep(alpha, value, behind), behind).Store(pixels.behind + pixel);
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

// Loads a plane of the tile's part of an image; pixels outside the image, and all of a plane that
// is null, are 0.
template <class T>
PEPESEG_HD void LoadPlane(const TileSplats& tile, const T* plane, int64_t stride, float* out) {
  if (plane == nullptr || tile.width < kTileSize || tile.height < kTileSize) {
    for (int i = 0; i < kTilePixels; i += kLanes) Lanes(0.0f).Store(out + i);
    if (plane == nullptr) return;
  }
  const T* corner = plane + static_cast<int64_t>(tile.y) * stride + static_cast<int64_t>(tile.x);
  for (int y = 0; y < tile.height; ++y) {
    for (int x = 0; x < tile.width; x += kBlockSize) {
      hn::StoreU(LoadBlockRow(corner + y * stride + x, tile.width - x), BlockRowTag(),
                 out + TilePixel(x, y));
    }
  }
}

// Loads the tile's part of the gradients. Pixels outside the image, and those with gradients of
// zero only (such as ignored ones), count as having seen no entry. Returns the end of the entries
// that any other pixel has seen.
PEPESEG_HD int32_t LoadTile(const TileSplats& tile, const ImageGrads& image, TileGrads& out) {
  alignas(64) float alpha[kTilePixels];
  LoadPlane(tile, image.r, image.stride, out.r);
  LoadPlane(tile, image.g, image.stride, out.g);
  LoadPlane(tile, image.b, image.stride, out.b);
  LoadPlane(tile, image.depth, image.stride, out.depth);
  LoadPlane(tile, image.alpha, image.stride, alpha);
  LoadPlane(tile, image.transmittance, image.stride, out.transmittance);
  LoadPlane(tile, image.last, image.stride, out.last);
  const Lanes zero(0.0f);
  Lanes most = zero;
  for (int i = 0; i < kTilePixels; i += kLanes) {
    const Lanes a = Lanes::Load(alpha + i);
    const Lanes grad = Abs(Lanes::Load(out.r + i)) + Abs(Lanes::Load(out.g + i)) +
                       Abs(Lanes::Load(out.b + i)) + Abs(Lanes::Load(out.depth + i)) + Abs(a);
    const Lanes last = Select(grad <= zero, zero, Lanes::Load(out.last + i));
    last.Store(out.last + i);
    most = Max(most, last);
    zero.Store(out.behind + i);
    (zero - a).Store(out.shape_behind + i);
  }
  return static_cast<int32_t>(hn::GetLane(hn::MaxOfLanes(FloatTag(), most.v)));
}

// Adds entry k at the pixels of a block that have blended it.
template <bool kWithShape>
PEPESEG_HD void AddBlock(const WalkedSplat& s, const SplatColor& color, Lanes index,
                         const TileCenters& centers, int block, TileGrads& pixels,
                         SplatSums& sums) {
  for (int i = 0; i < kBlockVectors; ++i) {
    const int pixel = block * kBlockPixels + i * kLanes;
    const Offsets at = OffsetsOf(s, centers, block, i);
    const Lanes power = PowerOf(s, at);
    const LaneMask live = (s.min_power <= power) & (index < Lanes::Load(pixels.last + pixel));
    AddPixels<kWithShape>(color, Alpha(s.opacity, Exp2(power)), live, at, pixels, pixel, sums);
  }
}

// Walks the entries before num_blended back to front and writes the slots of all entries; those of
// entries that no pixel has blended are zero. entry_blocks: [tile.count], of the tile.
template <bool kWithShape>
PEPESEG_HD void WalkBack(const TileSplats& tile, const uint16_t* entry_blocks, int32_t num_blended,
                         TileGrads& pixels, SplatGrad* slot_grad) {
  const int32_t* const entry_slot = tile.entry_slot;
  const TileCenters centers = CentersOf(tile);
  for (int32_t k = num_blended; k < tile.count; ++k) slot_grad[entry_slot[k]] = {};
  for (int32_t k = num_blended; k-- > 0;) {
    PrefetchSplat(tile, k - kPrefetchAhead);
    if (k >= kPrefetchAhead) __builtin_prefetch(slot_grad + entry_slot[k - kPrefetchAhead], 1);
    uint32_t blocks = entry_blocks[k];
    if (blocks == 0) {
      slot_grad[entry_slot[k]] = {};
      continue;
    }
    const Splat& splat = tile.splats[tile.entries[k]];
    const WalkedSplat s = PrepareSplat(splat);
    const SplatColor color = {Lanes(splat.r), Lanes(splat.g), Lanes(splat.b), Lanes(splat.depth)};
    const Lanes index(static_cast<float>(k));
    SplatSums sums = ZeroSums();
    for (; blocks != 0; blocks &= blocks - 1) {
      AddBlock<kWithShape>(s, color, index, centers, __builtin_ctz(blocks), pixels, sums);
    }
    slot_grad[entry_slot[k]] = Reduced(splat, sums);
  }
}

}  // namespace

void BlendTileBackward(const TileSplats& tile, const ImageGrads& image, SplatGrad* slot_grad) {
  TileGrads pixels;
  const int32_t num_blended = LoadTile(tile, image, pixels);
  const uint16_t* blocks = image.entry_blocks + tile.first;
  image.depth != nullptr || image.alpha != nullptr
      ? WalkBack<true>(tile, blocks, num_blended, pixels, slot_grad)
      : WalkBack<false>(tile, blocks, num_blended, pixels, slot_grad);
}

}  // namespace HWY_NAMESPACE
}  // namespace pepeseg
