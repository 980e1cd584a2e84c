#pragma once

#include <cassert>
#include <cstdint>
#include <type_traits>

namespace pepeseg {

// Parameters of Gaussians as planes (structure of arrays): parameter k of Gaussian i is at
// data[k * stride + i]. Gradients and Adam moments have the same layout.
inline constexpr int kMeanPlane = 0;      // x, y, z in the world, scene units
inline constexpr int kLogScalePlane = 3;  // natural logs of the standard deviations in scene units
inline constexpr int kRotationPlane = 6;  // quaternion w, x, y, z of any length; used normalised
inline constexpr int kOpacityPlane = 10;  // logit of the opacity
inline constexpr int kShPlane = 11;       // coefficient-major: plane kShPlane + 3 * k + channel
inline constexpr int kMaxShDegree = 3;

// Number of SH coefficients of one channel, and of planes, for a degree of 0..kMaxShDegree.
constexpr int NumShCoefficients(int sh_degree) { return (sh_degree + 1) * (sh_degree + 1); }
constexpr int NumPlanes(int sh_degree) { return kShPlane + 3 * NumShCoefficients(sh_degree); }

// Borrowed planes in memory of a backend.
template <class T>
struct BasicGaussianPlanes {
  T* data = nullptr;
  int64_t count = 0;   // Gaussians
  int64_t stride = 0;  // elements between planes, >= count
  int sh_degree = 0;   // of the stored coefficients, 0..3: there are NumPlanes(sh_degree) planes

  T* Plane(int k) const {
    assert(k >= 0 && k < NumPlanes(sh_degree));
    return data + k * stride;
  }
  // Implicit, as T* to const T* is.  NOLINTNEXTLINE(google-explicit-constructor)
  operator BasicGaussianPlanes<const T>() const requires(!std::is_const_v<T>) {
    return {data, count, stride, sh_degree};
  }
};

using GaussianPlanes = BasicGaussianPlanes<float>;
using ConstGaussianPlanes = BasicGaussianPlanes<const float>;

}  // namespace pepeseg
