#include "kernels/cpu/simd/kernels.h"

namespace pepeseg {
namespace HWY_NAMESPACE {

// Positional: in the order of the members of SimdKernels.
const SimdKernels& GetSimdKernels() {
  static constexpr SimdKernels kKernels = {HWY_STR(HWY_NAMESPACE),
                                           BlendTile,
                                           BlendTileBackward,
                                           PixelWeights,
                                           BlendFeatures,
                                           ProjectGaussians,
                                           UpdateParameters,
                                           ImageLossBand,
                                           FeatureCatchUpRange,
                                           FeatureRowsRange,
                                           FeatureUpdateRange,
                                           SmoothFeaturesRange,
                                           SmoothBackwardRange,
                                           GatePixels,
                                           ChoosePairs,
                                           GatherPairs,
                                           PairRowsVjp,
                                           PerceptionUnits,
                                           PerceptionRows,
                                           SimilarityRange,
                                           NearestNeighbours,
                                           RelaxColumns,
                                           LeastOf,
                                           NearestDescriptors,
                                           MultiplyRows,
                                           Activate,
                                           DepthwiseScanline,
                                           AttendWindow,
                                           NormalizeRows,
                                           ExpRow,
                                           SoftmaxSlots,
                                           MaskLogits,
                                           QuantizeMask,
                                           BlurSiftRow,
                                           SiftDifferences,
                                           SiftExtrema,
                                           SiftDirections,
                                           SiftDescriptor};
  return kKernels;
}

#if HWY_TARGET == HWY_AVX3
const SimdKernels& GetSimdKernelsVnni() {
  static const SimdKernels kKernels = [] {
    SimdKernels kernels = GetSimdKernels();
    kernels.name = "N_AVX3_DL";
    kernels.nearest_descriptors = NearestDescriptorsVnni;
    return kernels;
  }();
  return kKernels;
}
#endif

}  // namespace HWY_NAMESPACE
}  // namespace pepeseg
