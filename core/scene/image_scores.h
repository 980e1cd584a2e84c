#pragma once

#include <optional>

namespace pepeseg {

// Of a view's rendering against its photograph, or a mean over views; pixels under the ignore mask
// are left out.
struct ImageScores {
  double psnr = 0;                             // dB, peak 1
  double ssim = 0;                             // 11x11 Gaussian window, sigma 1.5
  std::optional<double> lpips = std::nullopt;  // where there are weights for it
};

}  // namespace pepeseg
