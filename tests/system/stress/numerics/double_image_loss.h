#pragma once

#include <cstdint>
#include <vector>

namespace pepeseg::testing {

// Computes ImageLoss and its gradient in double by the formulas of kernels/math. Separable windows
// make it fast enough for a thousand steps.
struct DoubleLoss {
  double loss = 0;
  double mse = 0;
  std::vector<double> color_grad;  // [3, side, side]
};
DoubleLoss DoubleImageLoss(const std::vector<double>& color, const std::vector<uint8_t>& photo,
                           int side, double ssim_weight);

}  // namespace pepeseg::testing
