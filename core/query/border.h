#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "kernels/half.h"
#include "kernels/ops/render.h"

namespace pepeseg {

// The pixels of a mask and those around it, [height, width], row-major.
struct BorderPixels {
  int width = 0, height = 0;
  std::vector<Half> features;             // [height, width, 32] as rendered, not gated
  std::vector<uint8_t> rgb;               // [height, width, 3] as rendered
  std::vector<float> similarity;          // [height, width] cosine to the query
  double threshold = 0;                   // cosine, of the query
  std::array<float, kFeatureSize> psi{};  // the gate at the scale of the query
};

// Number of pixels beyond a mask that RefineBorder reads.
inline constexpr int kBorderReach = 4;

// Moves the border of `mask`, [height, width] of 0 and 1, by at most one pixel. A pixel that has a
// pixel of the other side next to it, diagonals included, and a similarity close to the threshold
// joins the side whose gated feature and colour, of the pixels nearby, it resembles more. It stays
// unless the evidence is clear (METHOD.md section 4, "Borders"). Other pixels do not change.
void RefineBorder(const BorderPixels& pixels, std::span<uint8_t> mask);

}  // namespace pepeseg
