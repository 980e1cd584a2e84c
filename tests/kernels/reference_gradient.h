#pragma once

#include <vector>

#include "tests/kernels/reference_renderer.h"

namespace pepeseg {

// d loss / d image. The loss is linear: the sum of gradient * value over colour, alpha and depth.
struct ImageGrad {
  std::vector<double> color;         // [3, H, W]
  std::vector<double> alpha, depth;  // [H, W]
};

// Returns that loss.
double LossOf(const ReferenceImage& image, const ImageGrad& grad);

// Returns the gradient of the parameters, [planes, count], by the Vjp functions of kernels/math in
// double, one Gaussian and pixel at a time.
std::vector<double> ReferenceGradient(const ReferenceScene& scene, const PinholeView& view,
                                      const ReferenceOptions& options, const ImageGrad& grad);

}  // namespace pepeseg
