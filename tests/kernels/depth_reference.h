#pragma once

#include <cstdint>
#include <vector>

#include "kernels/ops/depth.h"

namespace pepeseg {

// What DepthLoss is given, on the host.
struct DepthImages {
  int width = 0, height = 0;
  std::vector<float> alpha, depth, prior;
  std::vector<uint8_t> ignore;  // or empty
  DepthLossArgs options;        // only its numbers
};

// The depth loss in double, every window looked at pixel by pixel, with formulas of its own
// (nothing of kernels/math).
struct ReferenceDepthLoss {
  bool skipped = false;
  double view = 0, local = 0, num_pixels = 0;
  std::vector<double> alpha_grad, depth_grad;
  std::vector<uint8_t> close_call;  // a residual next to 0: rounding decides its sign
};
ReferenceDepthLoss ComputeReferenceDepthLoss(const DepthImages& images);

}  // namespace pepeseg
