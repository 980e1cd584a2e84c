#pragma once

#include <hwy/highway.h>

#include "kernels/cpu/simd_kernels.h"

namespace pepeseg {
namespace HWY_NAMESPACE {

// The entries of SimdKernels for this instruction set.
const SimdKernels& GetSimdKernels();

void BlendTile(const TileSplats& tile, bool with_depth, TileColors& out);
void BlendTileBackward(const TileSplats& tile, bool with_depth, TileGrads& pixels,
                       const int32_t* entry_slot, SplatGrad* slot_grad);
void PixelWeights(const TileSplats& tile, int x, int y, float* weights);
void BlendFeatures(const TileSplats& tile, const float* features, const int32_t* visible_gaussian,
                   float* sums);
void ProjectGaussians(ProjectJob& job);
void UpdateParameters(ParameterJob& job);

}  // namespace HWY_NAMESPACE
}  // namespace pepeseg
