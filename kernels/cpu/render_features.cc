#include <algorithm>
#include <vector>

#include "kernels/cpu/cpu_backend.h"
#include "kernels/half.h"
#include "kernels/cpu/tile_splats.h"

namespace pepeseg {

// Tiles run in parallel. A tile is summed in float, in the working memory of its thread, and
// rounded to half once.
void CpuBackend::RenderFeatures(const RenderFeaturesArgs& args) {
  if (failed()) return;
  const RenderScratch& scratch = *args.scratch;
  constexpr int kTileValues = kTilePixels * kFeatureSize;
  std::vector<float> sums(pool_.num_threads() * kTileValues);
  pool_.ParallelFor(NumTilesOf(scratch), [&](int64_t i, int thread) {
    const TileSplats tile = TileAt(scratch, i);
    float* tile_sums = sums.data() + thread * kTileValues;
    simd_.blend_features(tile, args.features.data, args.confidence.data,
                         scratch.visible_gaussian.span().data, tile_sums);
    ForEachTilePixel(tile, scratch.width, [&](int64_t out, int in) {
      const float* from = tile_sums + in * kFeatureSize;
      std::transform(from, from + kFeatureSize, args.map.data + out * kFeatureSize, HalfFromFloat);
    });
  });
}

}  // namespace pepeseg
