#include <algorithm>

#include "kernels/cpu/cpu_backend.h"
#include "kernels/cpu/half.h"
#include "kernels/cpu/pixel_row.h"

namespace pepeseg {

void CpuBackend::RenderFeatures(const RenderFeaturesArgs& args) {
  const RenderScratch& scratch = *args.scratch;
  pool_.ParallelFor(scratch.height, [&](int64_t y, int) {
    for (int x = 0; x < scratch.width; ++x) {
      const auto pixel = static_cast<int32_t>(y * scratch.width + x);
      float sum[kFeatureSize] = {};
      ForEachBlended(scratch, pixel, [&](int32_t visible, float weight) {
        const float* feature =
            args.features.data + int64_t{scratch.visible_gaussian.span()[visible]} * kFeatureSize;
        for (int k = 0; k < kFeatureSize; ++k) sum[k] += weight * feature[k];
      });
      Half* out = args.map.data + int64_t{pixel} * kFeatureSize;
      std::transform(sum, sum + kFeatureSize, out, HalfFromFloat);
    }
  });
}

}  // namespace pepeseg
