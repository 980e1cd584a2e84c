#pragma once

#include <span>
#include <vector>

#include "core/scene/capture.h"

namespace pepeseg {

// Statistics of a view's depth prior for the depth loss (METHOD.md section 1.4).

// Returns the view's prior at 1 / `factor` of its size: the mean of the known pixels of each
// factor x factor block, NaN where a block has none. Cropped to whole blocks.
std::vector<float> ShrinkPrior(const View& view, int factor);

// The 1st and 99th percentiles of the known values. Values outside are taken for errors. At least
// one value must be known.
struct PriorBounds {
  float min = 0, max = 0;
};
PriorBounds InlierBounds(std::span<const float> prior);

// Returns the mean |value - mean| of the known values within the bounds; 0 without any.
double MeanDeviation(std::span<const float> prior, const PriorBounds& bounds);

}  // namespace pepeseg
