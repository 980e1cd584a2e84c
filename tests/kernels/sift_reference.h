#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "kernels/ops/sift.h"

namespace pepeseg {

// An 8-bit grey photograph, row by row.
struct GreyImage {
  int width = 0, height = 0;
  std::vector<uint8_t> pixels;
};

struct ReferenceFeature {
  double x, y, scale, angle;
  std::array<double, kSiftDescriptorSize> descriptor;  // before rounding to bytes
};

// Finds all features as kernels/ops/sift.h describes them, in double precision, by plain loops, and
// with octave 0 made from octave -1 (kernels/sift_scales.h). In no particular order.
std::vector<ReferenceFeature> ReferenceSift(const GreyImage& image);

}  // namespace pepeseg
