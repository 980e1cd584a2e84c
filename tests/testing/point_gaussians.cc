#include "tests/testing/point_gaussians.h"

#include <cmath>

namespace pepeseg::testing {

Gaussians PointGaussians(const Capture& capture, float size) {
  constexpr float kSh0 = 0.28209479f;
  Gaussians gaussians = Gaussians::Zero(static_cast<int64_t>(capture.points.size()), 0);
  for (size_t i = 0; i < capture.points.size(); ++i) {
    const ScenePoint& point = capture.points[i];
    for (int k = 0; k < 3; ++k) {
      gaussians.Plane(kMeanPlane + k)[i] = point.position[k];
      gaussians.Plane(kLogScalePlane + k)[i] = std::log(size);
      gaussians.Plane(kShPlane + k)[i] = (static_cast<float>(point.rgb[k]) / 255 - 0.5f) / kSh0;
    }
    gaussians.Plane(kRotationPlane)[i] = 1;
    gaussians.Plane(kOpacityPlane)[i] = 3;
  }
  return gaussians;
}

}  // namespace pepeseg::testing
