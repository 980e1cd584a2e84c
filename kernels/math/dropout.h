#pragma once

#include <cstdint>

#include "kernels/math/hd.h"

// Dropout of Gaussians (Park et al. 2025, "DropGaussian"; METHOD.md section 1, "Dropout"). A render
// leaves out each Gaussian with the probability `share`, and divides the opacities of the others by
// 1 - share, so that the expected opacity along a ray stays the same. The choice is a hash of the
// Gaussian's index and a seed, so that all backends make the same one and a repeated step repeats
// it.

namespace pepeseg {

// Returns whether a render leaves Gaussian `index` out. share: [0, 1).
PEPESEG_HD bool IsLeftOut(float share, uint32_t seed, uint32_t index) {
  if (share <= 0) return false;
  uint32_t h = index * 0x9e3779b9u ^ seed;
  h = (h ^ h >> 16) * 0x7feb352du;
  h = (h ^ h >> 15) * 0x846ca68bu;
  // 24 bits are a float without rounding.
  return static_cast<float>((h ^ h >> 16) >> 8) < share * 16777216.0f;
}

// Returns the factor of the opacities of the Gaussians that are left.
PEPESEG_HD float OpacityFactor(float share) { return 1 / (1 - share); }

}  // namespace pepeseg
