#pragma once

#include <cstdint>
#include <vector>

namespace pepeseg {

// Input of ImageLoss on the host.
struct LossImages {
  int width = 0, height = 0;
  std::vector<double> color;    // [3, H, W]
  std::vector<uint8_t> target;  // [H, W, 3]
  std::vector<uint8_t> ignore;  // [H, W]; may be empty
};
// The loss of ImageLossArgs in double, straight from its definition, one 11x11 window at a time.
struct ReferenceLoss {
  double l1 = 0, ssim = 0, mse = 0;  // means
  double num_pixel_channels = 0;

  double Total(double ssim_weight) const {
    return (1 - ssim_weight) * l1 + ssim_weight * (1 - ssim);
  }
};
ReferenceLoss ComputeReferenceLoss(const LossImages& images);

// Returns d Total / d color, [3, H, W], by the chain rule over windows.
std::vector<double> ComputeReferenceLossGradient(const LossImages& images, double ssim_weight);

}  // namespace pepeseg
