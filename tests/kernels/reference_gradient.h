#pragma once

#include <vector>

#include "tests/kernels/reference_renderer.h"

namespace pepeseg {

// d loss / d image, of the loss sum(color_grad * color) + sum(alpha_grad * alpha) + ...
struct ImageGrad {
  std::vector<double> color;         // [3, H, W]
  std::vector<double> alpha, depth;  // [H, W]
};

double LossOf(const ReferenceImage& image, const ImageGrad& grad);

// The gradient of the parameters [planes, count], by the Vjp functions of kernels/math in double,
// one Gaussian and pixel after the other.
std::vector<double> ReferenceGradient(const ReferenceScene& scene, const PinholeView& view,
                                      const ReferenceOptions& options, const ImageGrad& grad);

}  // namespace pepeseg
