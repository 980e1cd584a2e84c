#include "kernels/cpu/simd/kernels.h"
#include "kernels/cpu/simd/tile_walk.h"

// Forward blending of a tile: colours and depth, the weights at some pixels, or features. All walk
// the tile's entries front to back (WalkTile) with a vector of pixels of a block at a time, and
// keep the sums of the whole tile in arrays that fit the cache.

namespace pepeseg {
namespace HWY_NAMESPACE {
namespace {

// sum[0 .. kLanes) += weight * value.
PEPESEG_HD void AddTo(float* sum, Lanes weight, Lanes value) {
  MulAdd(weight, value, Lanes::Load(sum)).Store(sum);
}

// Starts all pixels with transmittance 1, and those outside the image with 0, which the walk skips.
PEPESEG_HD void ClearTransmittance(const TileSplats& tile, float* transmittance) {
  for (int y = 0; y < kTileSize; ++y) {
    for (int x = 0; x < kTileSize; ++x) {
      transmittance[TilePixel(x, y)] = x < tile.width && y < tile.height ? 1.0f : 0.0f;
    }
  }
}

// Sums of a tile, in the order of TilePixel.
struct TileColors {
  alignas(64) float r[kTilePixels], g[kTilePixels], b[kTilePixels], depth[kTilePixels];
  alignas(64) float transmittance[kTilePixels];
  alignas(64) float last[kTilePixels];  // end of the entries that the pixel has seen, as a float
};

// Records entry k as the end for the pixels of a block that have stopped now: their transmittance
// is negative, and their end is still the `count` that all start with.
PEPESEG_HD void NoteStops(int32_t k, int block, float count, TileColors& out) {
  for (int i = 0; i < kBlockPixels; i += kLanes) {
    const int pixel = block * kBlockPixels + i;
    const Lanes last = Lanes::Load(out.last + pixel);
    const LaneMask ended =
        (Lanes::Load(out.transmittance + pixel) < Lanes(0.0f)) & (Lanes(count) <= last);
    Select(ended, Lanes(static_cast<float>(k)), last).Store(out.last + pixel);
  }
}

// Blends colours, and depth if wanted.
template <bool kWithDepth>
PEPESEG_HD void BlendColors(const TileSplats& tile, uint16_t* entry_blocks, TileColors& out) {
  for (int i = 0; i < kTilePixels; ++i) {
    out.r[i] = out.g[i] = out.b[i] = out.depth[i] = 0;
    out.last[i] = static_cast<float>(tile.count);
  }
  ClearTransmittance(tile, out.transmittance);
  WalkTile(
      tile, out.transmittance,
      [&](int32_t k, int pixel, LaneMask, Lanes weight) __attribute__((always_inline)) {
        const Splat& s = tile.splats[tile.entries[k]];
        AddTo(out.r + pixel, weight, Lanes(s.r));
        AddTo(out.g + pixel, weight, Lanes(s.g));
        AddTo(out.b + pixel, weight, Lanes(s.b));
        if (kWithDepth) AddTo(out.depth + pixel, weight, Lanes(s.depth));
      },
      [&](int32_t k, uint32_t blended, uint32_t stopped) __attribute__((always_inline)) {
        if (entry_blocks != nullptr) entry_blocks[tile.first + k] = static_cast<uint16_t>(blended);
        for (; HWY_UNLIKELY(stopped != 0); stopped &= stopped - 1) {
          NoteStops(k, __builtin_ctz(stopped), static_cast<float>(tile.count), out);
        }
      });
}

// Writes `count` pixels of a row of a block, from `pixel` on in the tile, to `at` of the image.
PEPESEG_HD void StoreColors(const TileColors& colors, int pixel, int count, int64_t at,
                            const ImageColors& image) {
  const auto load = [&](const float* from) __attribute__((always_inline)) {
    return hn::LoadU(BlockRowTag(), from + pixel);
  };
  const auto store = [&](const float* color, float* out) __attribute__((always_inline)) {
    StoreBlockRow(load(color), out + at, count);
  };
  store(colors.r, image.r);
  store(colors.g, image.g);
  store(colors.b, image.b);
  if (image.depth != nullptr) store(colors.depth, image.depth);
  const auto transmittance = hn::Abs(load(colors.transmittance));
  StoreBlockRow(transmittance, image.transmittance + at, count);
  if (image.alpha != nullptr) {
    StoreBlockRow(hn::Sub(hn::Set(BlockRowTag(), 1.0f), transmittance), image.alpha + at, count);
  }
  if (HWY_LIKELY(count >= kBlockSize)) {
    const hn::RebindToSigned<BlockRowTag> d;
    hn::StoreU(hn::ConvertTo(d, load(colors.last)), d, image.last + at);
  } else {
    for (int i = 0; i < count; ++i) {
      image.last[at + i] = static_cast<int32_t>(colors.last[pixel + i]);
    }
  }
}

// Writes the part of the tile that lies inside the image.
PEPESEG_HD void StoreTile(const TileSplats& tile, const TileColors& colors,
                          const ImageColors& image) {
  const int64_t corner = static_cast<int64_t>(tile.y) * image.stride + static_cast<int64_t>(tile.x);
  for (int y = 0; y < tile.height; ++y) {
    for (int x = 0; x < tile.width; x += kBlockSize) {
      StoreColors(colors, TilePixel(x, y), Min(kBlockSize, tile.width - x),
                  corner + y * image.stride + x, image);
    }
  }
}

}  // namespace

void BlendTile(const TileSplats& tile, const ImageColors& image) {
  TileColors colors;
  image.depth != nullptr ? BlendColors<true>(tile, image.entry_blocks, colors)
                         : BlendColors<false>(tile, image.entry_blocks, colors);
  StoreTile(tile, colors, image);
}

void PixelWeights(const TileSplats& tile, std::span<const int32_t> pixels, float* weights) {
  // Only the given pixels are in play, so the walk ends when the last of them stops.
  alignas(64) float transmittance[kTilePixels] = {};
  int32_t number[kTilePixels];
  for (size_t i = 0; i < pixels.size(); ++i) {
    transmittance[pixels[i]] = 1;
    number[pixels[i]] = static_cast<int32_t>(i);
  }
  for (size_t i = 0; i < pixels.size() * tile.count; ++i) weights[i] = 0;
  WalkTile(
      tile, transmittance,
      [&](int32_t k, int pixel, LaneMask live, Lanes weight) __attribute__((always_inline)) {
        alignas(64) float lanes[kLanes];
        weight.Store(lanes);
        for (uint32_t bits = BitsOf(live); bits != 0; bits &= bits - 1) {
          const int lane = __builtin_ctz(bits);
          weights[int64_t{number[pixel + lane]} * tile.count + k] = lanes[lane];
        }
      },
      [](int32_t, uint32_t, uint32_t) {});
}

// A pixel's 32 sums are contiguous, so for features the vector runs along the channels and the
// lanes of the walk are taken one by one.
void BlendFeatures(const TileSplats& tile, const float* features, const float* confidence,
                   const int32_t* visible_gaussian, float* sums) {
  alignas(64) float transmittance[kTilePixels];
  ClearTransmittance(tile, transmittance);
  for (int i = 0; i < kTilePixels * kFeatureSize; ++i) sums[i] = 0;
  alignas(64) float confident[kTilePixels] = {};  // sums of weight * confidence
  WalkTile(
      tile, transmittance,
      [&](int32_t k, int pixel, LaneMask live, Lanes weight) __attribute__((always_inline)) {
        const int64_t gaussian = visible_gaussian[tile.entries[k]];
        const float* feature = features + gaussian * kFeatureSize;
        const float sure = confidence == nullptr ? 1.0f : confidence[gaussian];
        AddTo(confident + pixel, weight, Lanes(sure));
        alignas(64) float lanes[kLanes];
        (weight * Lanes(sure)).Store(lanes);
        for (uint32_t bits = BitsOf(live); bits != 0; bits &= bits - 1) {
          const int lane = __builtin_ctz(bits);
          float* sum = sums + (pixel + lane) * kFeatureSize;
          for (int c = 0; c < kFeatureSize; c += kLanes) {
            AddTo(sum + c, Lanes(lanes[lane]), Lanes::Load(feature + c));
          }
        }
      },
      [](int32_t, uint32_t, uint32_t) {});
  if (confidence == nullptr) return;
  // The weights sum to 1 - transmittance; a stopped pixel's is negative.
  for (int i = 0; i < kTilePixels; ++i) {
    if (confident[i] == 0) continue;
    const float factor = (1 - __builtin_fabsf(transmittance[i])) / confident[i];
    for (int c = 0; c < kFeatureSize; ++c) sums[i * kFeatureSize + c] *= factor;
  }
}

}  // namespace HWY_NAMESPACE
}  // namespace pepeseg
