#pragma once

#include <cstdint>
#include <vector>

#include "kernels/ops/render.h"

namespace pepeseg {

// Input of DepthLoss on the host.
struct DepthImages {
  int width = 0, height = 0;
  std::vector<float> alpha, depth, prior;
  std::vector<uint8_t> ignore;  // may be empty
  DepthLossArgs options;        // only its numbers are used
};

// The depth loss in double, with each window summed pixel by pixel and with formulas of its own
// (nothing of kernels/math).
struct ReferenceDepthLoss {
  bool skipped = false;
  double view = 0, local = 0, num_pixels = 0;
  std::vector<double> alpha_grad, depth_grad;
  std::vector<uint8_t> close_call;  // 1: a residual is nearly 0, so rounding decides its sign
};
ReferenceDepthLoss ComputeReferenceDepthLoss(const DepthImages& images);

}  // namespace pepeseg
