#pragma once

#include "kernels/math/hd.h"

namespace pepeseg {

// Vectors, matrices and quaternions of three dimensions. Plain aggregates: they stay in registers
// where the types of a matrix library do not.
template <class T>
struct Vec3 {
  T x, y, z;
};
template <class T>
PEPESEG_HD Vec3<T> operator+(Vec3<T> a, Vec3<T> b) {
  return {a.x + b.x, a.y + b.y, a.z + b.z};
}
template <class T>
PEPESEG_HD Vec3<T> operator-(Vec3<T> a, Vec3<T> b) {
  return {a.x - b.x, a.y - b.y, a.z - b.z};
}
template <class T>
PEPESEG_HD Vec3<T> operator*(T s, Vec3<T> a) {
  return {s * a.x, s * a.y, s * a.z};
}
template <class T>
PEPESEG_HD T Dot(Vec3<T> a, Vec3<T> b) {
  return MulAdd(a.x, b.x, MulAdd(a.y, b.y, a.z * b.z));
}
template <class T>
PEPESEG_HD Vec3<T> Cross(Vec3<T> a, Vec3<T> b) {
  return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}
// The elementwise product.
template <class T>
PEPESEG_HD Vec3<T> Scale(Vec3<T> a, Vec3<T> b) {
  return {a.x * b.x, a.y * b.y, a.z * b.z};
}

// a / |a|. Not finite for a = 0.
template <class T>
PEPESEG_HD Vec3<T> Normalize(Vec3<T> a) {
  return (T(1) / Sqrt(Dot(a, a))) * a;
}
// Gradient of a, from that of u = a / |a|: (u_grad - (u . u_grad) u) / |a|. The part along u
// vanishes, because the length of a does not matter.
template <class T>
PEPESEG_HD Vec3<T> NormalizeVjp(Vec3<T> a, Vec3<T> u_grad) {
  const T inv_norm = T(1) / Sqrt(Dot(a, a));
  const Vec3<T> u = inv_norm * a;
  return inv_norm * (u_grad - Dot(u, u_grad) * u);
}

// 3x3 matrix by rows.
template <class T>
struct Mat3 {
  Vec3<T> row0, row1, row2;
};
template <class T>
PEPESEG_HD Vec3<T> operator*(const Mat3<T>& m, Vec3<T> a) {
  return {Dot(m.row0, a), Dot(m.row1, a), Dot(m.row2, a)};
}
// a^T m, which is m^T a.
template <class T>
PEPESEG_HD Vec3<T> MulTransposed(const Mat3<T>& m, Vec3<T> a) {
  return {MulAdd(a.x, m.row0.x, MulAdd(a.y, m.row1.x, a.z * m.row2.x)),
          MulAdd(a.x, m.row0.y, MulAdd(a.y, m.row1.y, a.z * m.row2.y)),
          MulAdd(a.x, m.row0.z, MulAdd(a.y, m.row1.z, a.z * m.row2.z))};
}

// Rotation quaternion, real part first. It need not have length 1.
template <class T>
struct Quaternion {
  T w, x, y, z;
};
template <class T>
PEPESEG_HD T SquaredNorm(Quaternion<T> q) {
  return q.w * q.w + q.x * q.x + q.y * q.y + q.z * q.z;
}

// The rotation matrix of q / |q|. Not finite for q = 0.
template <class T>
PEPESEG_HD Mat3<T> RotationFromQuaternion(Quaternion<T> q) {
  const T s = T(2) / SquaredNorm(q);
  const T xx = s * q.x * q.x, yy = s * q.y * q.y, zz = s * q.z * q.z;
  const T xy = s * q.x * q.y, xz = s * q.x * q.z, yz = s * q.y * q.z;
  const T wx = s * q.w * q.x, wy = s * q.w * q.y, wz = s * q.w * q.z;
  return {{T(1) - yy - zz, xy - wz, xz + wy},
          {xy + wz, T(1) - xx - zz, yz - wx},
          {xz - wy, yz + wx, T(1) - xx - yy}};
}
// Gradient of q, from that of the matrix. It is perpendicular to q: the length of q does not
// matter.
template <class T>
PEPESEG_HD Quaternion<T> RotationFromQuaternionVjp(Quaternion<T> q, const Mat3<T>& r_grad) {
  const T inv_norm2 = T(1) / SquaredNorm(q);
  const T s = T(2) * inv_norm2;
  // R = I + s P(q), s = 2 / |q|^2 and P quadratic in q, so dR = s dP - (2 q.dq / |q|^2) s P. Below,
  // g__ are the combinations of r_grad that multiply the products of components in P.
  const T gxy = r_grad.row0.y + r_grad.row1.x, gxz = r_grad.row0.z + r_grad.row2.x;
  const T gyz = r_grad.row1.z + r_grad.row2.y;
  const T gwx = r_grad.row2.y - r_grad.row1.z, gwy = r_grad.row0.z - r_grad.row2.x;
  const T gwz = r_grad.row1.x - r_grad.row0.y;
  const T gx = r_grad.row1.y + r_grad.row2.z, gy = r_grad.row0.x + r_grad.row2.z;
  const T gz = r_grad.row0.x + r_grad.row1.y;
  Quaternion<T> grad = {s * (q.x * gwx + q.y * gwy + q.z * gwz),
                        s * (q.y * gxy + q.z * gxz + q.w * gwx - T(2) * q.x * gx),
                        s * (q.x * gxy + q.z * gyz + q.w * gwy - T(2) * q.y * gy),
                        s * (q.x * gxz + q.y * gyz + q.w * gwz - T(2) * q.z * gz)};
  // `grad` is that of s dP. P is quadratic, so grad . q = 2 s <P, r_grad>, and the second term is
  // (grad . q) / |q|^2 times q.
  const T along = (grad.w * q.w + grad.x * q.x + grad.y * q.y + grad.z * q.z) * inv_norm2;
  return {grad.w - along * q.w, grad.x - along * q.x, grad.y - along * q.y, grad.z - along * q.z};
}

}  // namespace pepeseg
