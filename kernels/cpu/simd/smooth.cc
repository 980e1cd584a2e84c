#include "kernels/cpu/feature_jobs.h"
#include "kernels/cpu/simd/feature_lanes.h"
#include "kernels/cpu/simd/kernels.h"
#include "kernels/math/direction.h"

namespace pepeseg {
namespace HWY_NAMESPACE {

// Adds the directions of the drawn neighbours in the order of the columns, and normalises the sum.
void SmoothFeaturesRange(const SmoothFeaturesArgs& args, FeatureRange range) {
  const bool every = args.gaussian.size == 0;
  for (int64_t i = range.first; i < range.end; ++i) {
    const int64_t gaussian = every ? i : args.gaussian.data[i];
    const int32_t* neighbors = args.graph.neighbor.data + gaussian * args.graph.num_neighbors;
    FeatureLanes sum = ZeroFeature();
    for (uint32_t left = args.drawn; left != 0; left &= left - 1) {
      const int64_t neighbor = neighbors[__builtin_ctz(left)];
      const FeatureLanes feature = LoadFeature(args.features.data + neighbor * kFeatureSize);
      FeatureLanes direction;
      Direction(feature.v, kVectors, direction.v);
      HWY_UNROLL(kVectors)
      for (int k = 0; k < kVectors; ++k) sum.v[k] = sum.v[k] + direction.v[k];
    }
    FeatureLanes smoothed;
    args.inv_length.data[gaussian] = First(Direction(sum.v, kVectors, smoothed.v));
    StoreFeature(smoothed, args.smoothed.data + gaussian * kFeatureSize);
  }
}

// Gathers d loss / d fbar from the pixels of each column and passes it through the normalisation.
void SmoothBackwardRange(const SmoothBackwardArgs& args, FeatureRange range) {
  for (int64_t i = range.first; i < range.end; ++i) {
    FeatureLanes grad = GatherColumn(args.columns, i, args.pixel_grad.data);
    const int64_t gaussian = args.columns.gaussian.data[i];
    const FeatureLanes smoothed = LoadFeature(args.smoothed.data + gaussian * kFeatureSize);
    DirectionVjp(smoothed.v, Lanes(args.inv_length.data[gaussian]), kVectors, grad.v);
    StoreFeature(grad, args.sum_grad.data + i * kFeatureSize);
  }
}

}  // namespace HWY_NAMESPACE
}  // namespace pepeseg
