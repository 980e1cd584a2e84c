#pragma once

#include <hwy/highway.h>

#include "kernels/cpu/simd_kernels.h"

namespace pepeseg {
namespace HWY_NAMESPACE {

// Returns the table of this instruction set. The functions below are its members, described there.
const SimdKernels& GetSimdKernels();
#if HWY_TARGET == HWY_AVX3
// Returns the table for machines with AVX-512 VNNI.
const SimdKernels& GetSimdKernelsVnni();
#endif

void BlendTile(const TileSplats& tile, const ImageColors& image);
void BlendTileBackward(const TileSplats& tile, const ImageGrads& image, SplatGrad* slot_grad);
void PixelWeights(const TileSplats& tile, std::span<const int32_t> pixels, float* weights);
void BlendFeatures(const TileSplats& tile, const float* features, const float* confidence,
                   const int32_t* visible_gaussian, float* sums);
void ProjectGaussians(ProjectJob& job);
void UpdateParameters(ParameterJob& job);
void ImageLossBand(LossBand& band);
void FeatureCatchUpRange(const FeatureCatchUpArgs& args, FeatureRange range);
void FeatureRowsRange(const FeatureRowsArgs& args, FeatureRange range);
void FeatureUpdateRange(const FeatureUpdateArgs& args, FeatureRange range);
void SmoothFeaturesRange(const SmoothFeaturesArgs& args, FeatureRange range);
void SmoothBackwardRange(const SmoothBackwardArgs& args, FeatureRange range);
void GatePixels(const PairJob& job, int first, int end);
void ChoosePairs(const PairJob& job, const PairPanel& panel, PairBlock& block);
void GatherPairs(const PairJob& job, const PairPanel& panel, int first, int end);
void PairRowsVjp(const PairJob& job, PairBlock& block);
void PerceptionUnits(const PerceptionJob& job, FeatureRange range);
void PerceptionRows(const PerceptionJob& job, PerceptionBlock& block);
void SimilarityRange(const SimilarityArgs& args, const float* query_units, FeatureRange range);
void NearestNeighbours(const NearestJob& job, FeatureRange range);
void RelaxColumns(const RelaxJob& job, ColumnRange range);
float LeastOf(const float* values, int32_t padded);
void NearestDescriptors(const MatchJob& job);
#if HWY_TARGET == HWY_AVX3
void NearestDescriptorsVnni(const MatchJob& job);
#endif
void MultiplyRows(const RowsProduct& job);
void Activate(Activation activation, float* values, int64_t count);
void DepthwiseScanline(const DepthwiseConvolveArgs& args, int image, int y);
void AttendWindow(const WindowAttentionArgs& args, int64_t window, int head,
                  AttentionScratch& scratch);
void NormalizeRows(const PromptNorm& norm, int size, float epsilon, float* rows, int count);
void ExpRow(float* scores, int count, float& best, float& total);
void SoftmaxSlots(const SlotSoftmax& job);
void MaskLogits(const float* cells, int count, const float* products, float* logits);
void QuantizeMask(const MaskRow& row);
void BlurSiftRow(const SiftBlurRow& row);
void SiftDifferences(const float* const* levels, int width, float* const* out);
int SiftExtrema(const SiftExtremaRow& row, int32_t* columns);
void SiftDirections(const SiftWindow& window, float* histogram);
void SiftDescriptor(const SiftWindow& window, const SiftDirection& direction, uint8_t* descriptor);

}  // namespace HWY_NAMESPACE
}  // namespace pepeseg
