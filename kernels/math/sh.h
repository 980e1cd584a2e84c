#pragma once

#include "kernels/math/vec.h"

// Colour by direction (Kerbl et al. 2023): real spherical harmonics up to degree 3, with the signs
// and the order of 3DGS. `dir` is the unit vector from the camera to the Gaussian, in the world.

namespace pepeseg {

// Normalisation constants of the basis functions, named by degree and, from degree 2 on, by shape.
inline constexpr float kSh0 = 0.28209479177387814f;
inline constexpr float kSh1 = 0.4886025119029199f;
inline constexpr float kSh20 = 1.0925484305920792f, kSh21 = 0.31539156525252005f,
                       kSh22 = 0.5462742152960396f;
inline constexpr float kSh30 = 0.5900435899266435f, kSh31 = 2.890611442640554f,
                       kSh32 = 0.4570457994644658f, kSh33 = 0.3731763325901154f,
                       kSh34 = 1.445305721320277f;

// Writes the values of the basis functions to basis[0 .. (degree + 1)^2). degree: 0..3.
template <class T>
PEPESEG_HD void ShBasis(Vec3<T> dir, int degree, T* basis) {
  const T x = dir.x, y = dir.y, z = dir.z;
  basis[0] = T(kSh0);
  if (degree < 1) return;
  basis[1] = T(-kSh1) * y;
  basis[2] = T(kSh1) * z;
  basis[3] = T(-kSh1) * x;
  if (degree < 2) return;
  const T xx = x * x, yy = y * y, zz = z * z;
  basis[4] = T(kSh20) * x * y;
  basis[5] = T(-kSh20) * y * z;
  basis[6] = T(kSh21) * (T(2) * zz - xx - yy);
  basis[7] = T(-kSh20) * x * z;
  basis[8] = T(kSh22) * (xx - yy);
  if (degree < 3) return;
  basis[9] = T(-kSh30) * y * (T(3) * xx - yy);
  basis[10] = T(kSh31) * x * y * z;
  basis[11] = T(-kSh32) * y * (T(4) * zz - xx - yy);
  basis[12] = T(kSh33) * z * (T(2) * zz - T(3) * (xx + yy));
  basis[13] = T(-kSh32) * x * (T(4) * zz - xx - yy);
  basis[14] = T(kSh34) * z * (xx - yy);
  basis[15] = T(-kSh30) * x * (xx - T(3) * yy);
}

// Gradient of `dir`, from the gradients g[0 .. (degree + 1)^2) of the basis values. NormalizeVjp
// projects it onto the sphere.
template <class T>
PEPESEG_HD Vec3<T> ShBasisVjp(Vec3<T> dir, int degree, const T* g) {
  const T x = dir.x, y = dir.y, z = dir.z;
  Vec3<T> out = {T(0), T(0), T(0)};
  if (degree < 1) return out;
  out = T(kSh1) * Vec3<T>{T(0) - g[3], T(0) - g[1], g[2]};
  if (degree < 2) return out;
  const T g4 = T(kSh20) * g[4], g5 = T(-kSh20) * g[5], g6 = T(2 * kSh21) * g[6];
  const T g7 = T(-kSh20) * g[7], g8 = T(2 * kSh22) * g[8];
  out.x = out.x + y * g4 + z * g7 + x * (g8 - g6);
  out.y = out.y + x * g4 + z * g5 - y * (g8 + g6);
  out.z = out.z + y * g5 + x * g7 + T(2) * z * g6;
  if (degree < 3) return out;
  const T xx = x * x, yy = y * y, zz = z * z;
  const T g9 = T(-3 * kSh30) * g[9], g10 = T(kSh31) * g[10], g11 = T(-kSh32) * g[11];
  const T g12 = T(3 * kSh33) * g[12], g13 = T(-kSh32) * g[13], g14 = T(kSh34) * g[14];
  const T g15 = T(-3 * kSh30) * g[15];
  const T xy = x * y, xz = x * z, yz = y * z;
  out.x = out.x + T(2) * xy * (g9 - g11) + yz * g10 + g13 * (T(4) * zz - T(3) * xx - yy) +
          T(2) * xz * (g14 - g12) + g15 * (xx - yy);
  out.y = out.y + g9 * (xx - yy) + xz * g10 + g11 * (T(4) * zz - xx - T(3) * yy) -
          T(2) * yz * (g12 + g14) - T(2) * xy * (g13 + g15);
  out.z = out.z + xy * g10 + T(8) * z * (y * g11 + x * g13) + g12 * (T(2) * zz - xx - yy) +
          g14 * (xx - yy);
  return out;
}

// One channel of the colour: max(0, 0.5 + sum of basis * coefficient), so that coefficients of 0
// are mid-grey. Photographs lie in [0, 1]; the colour may exceed 1.
template <class T>
PEPESEG_HD T ShChannel(T weighted_sum) {
  return Max(weighted_sum + T(0.5f), T(0));
}
// Gradient of the weighted sum, from that of the channel: 0 where the channel is clamped to 0.
template <class T>
PEPESEG_HD T ShChannelVjp(T weighted_sum, T color_grad) {
  return Select(T(0) < weighted_sum + T(0.5f), color_grad, T(0));
}

}  // namespace pepeseg
