#pragma once

#include <cmath>

#include "kernels/ops/render.h"

namespace pepeseg {

// Smallest length of a blended feature of a pixel that may be in a mask. Shorter ones are of faint
// Gaussians in front of the empty background. Inside an object the length is near 1, at the border
// of two objects about 0.7.
inline constexpr float kMinPixelNorm = 0.4f;

// Returns the length of a feature, [32].
inline double FeatureNorm(const float* feature) {
  double squares = 0;
  for (int k = 0; k < kFeatureSize; ++k) squares += double{feature[k]} * feature[k];
  return std::sqrt(squares);
}

}  // namespace pepeseg
