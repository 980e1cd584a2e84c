#pragma once

#include <cmath>

#include "kernels/ops/render.h"

namespace pepeseg {

// A pixel whose feature is shorter is in no mask: Gaussians that are hardly there would stand for
// the nothing behind them. Inside a thing the length is near 1, on the border of two about 0.7.
inline constexpr float kMinPixelNorm = 0.4f;

inline double FeatureNorm(const float* feature) {  // [32]
  double squares = 0;
  for (int k = 0; k < kFeatureSize; ++k) squares += double{feature[k]} * feature[k];
  return std::sqrt(squares);
}

}  // namespace pepeseg
