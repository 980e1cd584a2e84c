#include "kernels/cpu/simd/kernels.h"
#include "kernels/cpu/simd/tile_walk.h"

namespace pepeseg {
namespace HWY_NAMESPACE {
namespace {

constexpr WalkWindow kWholeTile = {0, kTileSize, 0, kVectorsPerRow};

PEPESEG_HD void AddTo(float* sum, Lanes weight, Lanes value) {
  MulAdd(weight, value, Lanes::Load(sum)).Store(sum);
}

// Pixels outside the image are out of play from the start.
PEPESEG_HD void ClearTransmittance(const TileSplats& tile, float* transmittance) {
  for (int i = 0; i < kTilePixels; ++i) {
    const bool inside = i % kTileSize < tile.width && i / kTileSize < tile.height;
    transmittance[i] = inside ? 1.0f : 0.0f;
  }
}

PEPESEG_HD void FinishTransmittance(float* transmittance) {
  for (int i = 0; i < kTilePixels; i += kLanes) {
    Abs(Lanes::Load(transmittance + i)).Store(transmittance + i);
  }
}

template <bool kWithDepth>
PEPESEG_HD void BlendColors(const TileSplats& tile, TileColors& out) {
  for (int i = 0; i < kTilePixels; ++i) {
    out.r[i] = out.g[i] = out.b[i] = out.depth[i] = out.last[i] = 0;
  }
  ClearTransmittance(tile, out.transmittance);
  WalkTile(
      tile, kWholeTile, out.transmittance,
      [&](int32_t k, int pixel, LaneMask live, Lanes weight) __attribute__((always_inline)) {
        const Splat& s = tile.splats[tile.entries[k]];
        AddTo(out.r + pixel, weight, Lanes(s.r));
        AddTo(out.g + pixel, weight, Lanes(s.g));
        AddTo(out.b + pixel, weight, Lanes(s.b));
        if (kWithDepth) AddTo(out.depth + pixel, weight, Lanes(s.depth));
        const Lanes last = Lanes::Load(out.last + pixel);
        Select(live, Lanes(static_cast<float>(k + 1)), last).Store(out.last + pixel);
      });
  FinishTransmittance(out.transmittance);
}

}  // namespace

void BlendTile(const TileSplats& tile, bool with_depth, TileColors& out) {
  with_depth ? BlendColors<true>(tile, out) : BlendColors<false>(tile, out);
}

void PixelWeights(const TileSplats& tile, int x, int y, float* weights) {
  alignas(64) float transmittance[kTilePixels];
  ClearTransmittance(tile, transmittance);
  const int vector = x / kLanes;
  for (int32_t k = 0; k < tile.count; ++k) weights[k] = 0;
  // Neighbours in the vector go out of play, so that the walk ends with the pixel asked for.
  for (int i = 0; i < kTileSize; ++i) {
    if (i != x) transmittance[y * kTileSize + i] = 0;
  }
  WalkTile(
      tile, {y, y + 1, vector, vector + 1},
      transmittance, [&](int32_t k, int, LaneMask, Lanes weight) __attribute__((always_inline)) {
        alignas(64) float lanes[kLanes];
        weight.Store(lanes);
        weights[k] = lanes[x % kLanes];
      });
}

void BlendFeatures(const TileSplats& tile, const float* features, const int32_t* visible_gaussian,
                   float* sums) {
  alignas(64) float transmittance[kTilePixels];
  ClearTransmittance(tile, transmittance);
  for (int i = 0; i < kTilePixels * kFeatureSize; ++i) sums[i] = 0;
  WalkTile(
      tile, kWholeTile, transmittance,
      [&](int32_t k, int pixel, LaneMask live, Lanes weight) __attribute__((always_inline)) {
        const float* feature = features + int64_t{visible_gaussian[tile.entries[k]]} * kFeatureSize;
        alignas(64) float lanes[kLanes];
        weight.Store(lanes);
        for (uint32_t bits = BitsOf(live); bits != 0; bits &= bits - 1) {
          const int lane = __builtin_ctz(bits);
          float* sum = sums + (pixel + lane) * kFeatureSize;
          for (int c = 0; c < kFeatureSize; c += kLanes) {
            AddTo(sum + c, Lanes(lanes[lane]), Lanes::Load(feature + c));
          }
        }
      });
}

}  // namespace HWY_NAMESPACE
}  // namespace pepeseg
