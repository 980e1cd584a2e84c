#pragma once

#include <span>
#include <vector>

#include "core/scene/capture.h"

namespace pepeseg {

inline constexpr float kNoScale = 0;
inline constexpr int kNumScaleKnots = 1000;

// The size of each mask of a view in space (GARField, eq. 2; method.md section 2), scene units:
// 2 sqrt(var X + var Y + var Z) of its pixels, back-projected with `depth` [height, width] (0: none
// known), after a 3x3 majority filter. kNoScale where fewer than 8 pixels are left. Pixels under
// the view's ignore mask are left out.
std::vector<float> MaskScales(const View& view, std::span<const float> depth);

// Quantiles k / 999 of the scales over 0, linear between the sorted ones; empty when there is none.
std::vector<float> ScaleQuantiles(std::vector<float> scales);

}  // namespace pepeseg
