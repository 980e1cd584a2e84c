#pragma once

#include "kernels/cpu/simd/lanes.h"
#include "kernels/gaussian_planes.h"
#include "kernels/math/projection.h"
#include "kernels/math/sh.h"

namespace pepeseg {
namespace HWY_NAMESPACE {

// 1 to kLanes adjacent Gaussians of some planes, one for each lane. Lanes beyond `count` hold 0.
struct GaussianGroup {
  const float* data;  // plane 0 of the first of them
  int64_t stride;
  int count;

  PEPESEG_HD Lanes At(int plane) const { return LoadSome(data + plane * stride, count); }
};

PEPESEG_HD GaussianShape<Lanes> LoadShape(const GaussianGroup& g) {
  return {{g.At(kMeanPlane), g.At(kMeanPlane + 1), g.At(kMeanPlane + 2)},
          {g.At(kLogScalePlane), g.At(kLogScalePlane + 1), g.At(kLogScalePlane + 2)},
          {g.At(kRotationPlane), g.At(kRotationPlane + 1), g.At(kRotationPlane + 2),
           g.At(kRotationPlane + 3)}};
}

// Returns one colour channel before ShChannel: the sum of basis * coefficient.
PEPESEG_HD Lanes WeightedSum(const GaussianGroup& g, const Lanes* basis, int num_coefficients,
                             int channel) {
  Lanes sum(0.0f);
  for (int k = 0; k < num_coefficients; ++k) {
    sum = MulAdd(basis[k], g.At(kShPlane + 3 * k + channel), sum);
  }
  return sum;
}

}  // namespace HWY_NAMESPACE
}  // namespace pepeseg
