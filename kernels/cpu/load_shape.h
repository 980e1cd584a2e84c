#pragma once

#include "kernels/gaussian_planes.h"
#include "kernels/math/projection.h"

namespace pepeseg {

// Returns mean, log scales and rotation of Gaussian i. The host must be able to read the planes.
inline GaussianShape<float> LoadShape(const ConstGaussianPlanes& planes, int64_t i) {
  const auto at = [&](int plane) { return planes.Plane(plane)[i]; };
  return {
      {at(kMeanPlane), at(kMeanPlane + 1), at(kMeanPlane + 2)},
      {at(kLogScalePlane), at(kLogScalePlane + 1), at(kLogScalePlane + 2)},
      {at(kRotationPlane), at(kRotationPlane + 1), at(kRotationPlane + 2), at(kRotationPlane + 3)}};
}

}  // namespace pepeseg
