#include "kernels/cpu/simd/kernels.h"

namespace pepeseg {
namespace HWY_NAMESPACE {

// Positional: in the order of the members of SimdKernels.
const SimdKernels& GetSimdKernels() {
  static constexpr SimdKernels kKernels = {
      HWY_STR(HWY_NAMESPACE), BlendTile,        BlendTileBackward,  PixelWeights,
      BlendFeatures,          ProjectGaussians, UpdateParameters,   ImageLossBand,
      FeatureCatchUpRange,    FeatureRowsRange, FeatureUpdateRange, SmoothFeaturesRange,
      SmoothBackwardRange,    GatePixels,       PairRows,           PairRowsVjp,
      PerceptionUnits,        PerceptionRows,   SimilarityRange,    NearestNeighbours,
      RelaxColumns,           LeastOf};
  return kKernels;
}

}  // namespace HWY_NAMESPACE
}  // namespace pepeseg
