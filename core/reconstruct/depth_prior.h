#pragma once

#include <span>
#include <vector>

#include "core/scene/capture.h"

namespace pepeseg {

// The view's prior at 1 / `factor` of its size: the mean of the known pixels of each block, NaN
// where a block has none. Cropped to whole blocks.
std::vector<float> ShrinkPrior(const View& view, int factor);

// The 1 and 99 percentiles of the known values, of which there is at least one: what lies outside
// is taken for an error.
struct PriorBounds {
  float min = 0, max = 0;
};
PriorBounds InlierBounds(std::span<const float> prior);

// Mean |value - mean| of the known values within the bounds.
double MeanDeviation(std::span<const float> prior, const PriorBounds& bounds);

}  // namespace pepeseg
