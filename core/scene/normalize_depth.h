#pragma once

#include <vector>

namespace pepeseg {

// Maps the 0.1 and 99.9 percentiles of what is known to 0 and 1, and clamps there; NaN stays NaN.
// Empty, as there is nothing to learn from it: the two are the same, or nothing is known.
std::vector<float> NormalizeDepth(std::vector<float> values);

}  // namespace pepeseg
