#include "core/edit/recolor_gaussians.h"

#include <algorithm>
#include <cmath>

#include "kernels/gaussian_planes.h"
#include "kernels/math/sh.h"

namespace pepeseg {
namespace {

// Coefficients of 0 stand for this colour, see ShChannel.
constexpr double kMiddle = 0.5;
// A mean below it is raised to it first: what is nearly black has hardly a shade to multiply.
constexpr double kMinLuminance = 0.05;

Eigen::Vector3d Coefficient(const Gaussians& gaussians, int k, int64_t row) {
  const auto at = [&](int channel) { return gaussians.Plane(kShPlane + 3 * k + channel)[row]; };
  return {at(0), at(1), at(2)};
}

}  // namespace

void ScaleColor(const Eigen::Array3d& factor, int64_t row, Gaussians& gaussians) {
  for (int channel = 0; channel < 3; ++channel) {
    for (int k = 0; k < NumShCoefficients(gaussians.sh_degree); ++k) {
      float& value = gaussians.Plane(kShPlane + 3 * k + channel)[row];
      const double moved_middle = k == 0 ? (factor[channel] - 1) * kMiddle / kSh0 : 0;
      value = static_cast<float>(factor[channel] * value + moved_middle);
    }
  }
}

void RecolorGaussians(const NewColor& to, std::span<const int64_t> rows, Gaussians& gaussians) {
  const Eigen::RowVector3d luminance(0.2126, 0.7152, 0.0722);
  double sum = 0, weights = 0;
  for (const int64_t row : rows) {
    const double opacity = 1 / (1 + std::exp(-double{gaussians.Plane(kOpacityPlane)[row]}));
    const Eigen::Vector3d color =
        (kMiddle + (kSh0 * Coefficient(gaussians, 0, row)).array()).cwiseMax(0).cwiseMin(1);
    sum += opacity * luminance.dot(color);
    weights += opacity;
  }
  const double before = weights > 0 ? sum / weights : 0;
  const double mean = std::max(kMinLuminance, before);
  const Eigen::Matrix3d change =
      (1 - to.strength) * Eigen::Matrix3d::Identity() + (to.strength / mean) * to.color * luminance;
  // The change is linear in the colour, so it applies to each coefficient; the first one also takes
  // what it makes of the middle.
  const Eigen::Vector3d middle = Eigen::Vector3d::Constant(kMiddle);
  const Eigen::Vector3d raised = to.strength * (mean - before) / mean * to.color;
  const Eigen::Vector3d moved_middle = (change * middle + raised - middle) / kSh0;
  for (int k = 0; k < NumShCoefficients(gaussians.sh_degree); ++k) {
    for (const int64_t row : rows) {
      Eigen::Vector3d changed = change * Coefficient(gaussians, k, row);
      if (k == 0) changed += moved_middle;
      for (int channel = 0; channel < 3; ++channel) {
        gaussians.Plane(kShPlane + 3 * k + channel)[row] = static_cast<float>(changed[channel]);
      }
    }
  }
}

}  // namespace pepeseg
