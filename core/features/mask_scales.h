#pragma once

#include <span>
#include <vector>

#include "core/scene/capture.h"

namespace pepeseg {

inline constexpr float kNoScale = 0;
inline constexpr int kNumScaleKnots = 1000;

// The size of each mask of a view in space (GARField, eq. 2; METHOD.md section 2), scene units:
// 2 sqrt(var X + var Y + var Z) of its pixels, back-projected with `depth` [height, width] (0: none
// known), after a 3x3 majority filter. kNoScale where fewer than 8 pixels are left. Pixels under
// the view's ignore mask are left out.
std::vector<float> MaskScales(const View& view, std::span<const float> depth);

// What the query scale is measured by: the scale in scene units at 0, 1 / 999, .. 1, ascending.
// Empty when no scale is over 0.
//
// Its quantiles, linear between the sorted scales.
std::vector<float> ScaleQuantiles(std::vector<float> scales);
// Evenly from the smallest to the largest; that is the 99 percentile, so that a stray mask does not
// stretch the rest.
std::vector<float> EvenScales(std::vector<float> scales);

}  // namespace pepeseg
