#pragma once

#include "kernels/math/vec.h"

// Projection of a Gaussian to a splat of the image (EWA splatting, Zwicker et al. 2001; Kerbl et
// al. 2023; METHOD.md section 1, "Rendering"). Lengths are in scene units, image coordinates in
// pixels with pixel centres at integer + 0.5. Camera axes: x right, y down, z forward.

namespace pepeseg {

// Added to both variances of the projected Gaussian, squared pixels, so that no splat is thinner
// than a pixel can sample (3DGS).
inline constexpr float kDilation = 0.3f;

// A pinhole camera as the projection reads it.
template <class T>
struct ProjectionCamera {
  Mat3<T> rotation;  // cam_from_world
  Vec3<T> translation;
  T fx, fy, cx, cy;
  // Bounds on x / z and y / z in the Jacobian: the edges of the image plus 0.3 tan(fov / 2), which
  // is 1.3 tan(fov / 2), as in 3DGS, for a centred principal point.
  T min_x, max_x, min_y, max_y;
};

// `view` is a PinholeView of kernels/ops/render.h.
template <class T, class View>
PEPESEG_HD ProjectionCamera<T> MakeProjectionCamera(const View& view) {
  const auto* m = view.cam_from_world;
  ProjectionCamera<T> camera;
  camera.rotation = {
      {T(m[0]), T(m[1]), T(m[2])}, {T(m[4]), T(m[5]), T(m[6])}, {T(m[8]), T(m[9]), T(m[10])}};
  camera.translation = {T(m[3]), T(m[7]), T(m[11])};
  camera.fx = T(view.fx);
  camera.fy = T(view.fy);
  camera.cx = T(view.cx);
  camera.cy = T(view.cy);
  const float margin_x = 0.15f * view.width / view.fx, margin_y = 0.15f * view.height / view.fy;
  camera.min_x = T(-view.cx / view.fx - margin_x);
  camera.max_x = T((view.width - view.cx) / view.fx + margin_x);
  camera.min_y = T(-view.cy / view.fy - margin_y);
  camera.max_y = T((view.height - view.cy) / view.fy + margin_y);
  return camera;
}

// Position of the camera in the world.
template <class T>
PEPESEG_HD Vec3<T> CameraCenter(const ProjectionCamera<T>& camera) {
  return T(-1) * MulTransposed(camera.rotation, camera.translation);
}

// `mean`, a point of the world, in camera axes.
template <class T>
PEPESEG_HD Vec3<T> MeanInCam(const ProjectionCamera<T>& camera, Vec3<T> mean) {
  return camera.rotation * mean + camera.translation;
}

// A symmetric 2x2 matrix.
template <class T>
struct Sym2 {
  T xx, xy, yy;
};

// J W R as two rows: J is the Jacobian of the pinhole projection at the mean, W the rotation of the
// camera and R that of the Gaussian. Column k is the image of the k-th axis of the Gaussian, in
// pixels for one scene unit of its length.
template <class T>
struct ProjectedAxes {
  Vec3<T> jw0, jw1;    // J W
  Vec3<T> row0, row1;  // J W R
};
template <class T>
PEPESEG_HD ProjectedAxes<T> ProjectAxes(const ProjectionCamera<T>& camera, Vec3<T> mean_in_cam,
                                        const Mat3<T>& rotation) {
  const T inv_z = T(1) / mean_in_cam.z;
  const T x = Min(Max(mean_in_cam.x * inv_z, camera.min_x), camera.max_x);
  const T y = Min(Max(mean_in_cam.y * inv_z, camera.min_y), camera.max_y);
  ProjectedAxes<T> axes;
  axes.jw0 = (camera.fx * inv_z) * (camera.rotation.row0 - x * camera.rotation.row2);
  axes.jw1 = (camera.fy * inv_z) * (camera.rotation.row1 - y * camera.rotation.row2);
  axes.row0 = MulTransposed(rotation, axes.jw0);
  axes.row1 = MulTransposed(rotation, axes.jw1);
  return axes;
}

// The projected covariance U U^T, U = J W R diag(scale), without dilation.
template <class T>
PEPESEG_HD Sym2<T> ProjectCovariance(const ProjectedAxes<T>& axes, Vec3<T> scale) {
  const Vec3<T> u0 = Scale(axes.row0, scale), u1 = Scale(axes.row1, scale);
  return {Dot(u0, u0), Dot(u0, u1), Dot(u1, u1)};
}

// A projected Gaussian.
template <class T>
struct Projection {
  Vec3<T> mean_in_cam;
  T x, y;         // pixels
  Sym2<T> conic;  // inverse of the dilated covariance
  T determinant;  // of the dilated covariance; positive and finite unless the input is unusable
};

// Geometry of a Gaussian as it is stored (kernels/gaussian_planes.h).
template <class T>
struct GaussianShape {
  Vec3<T> mean;
  Vec3<T> log_scale;
  Quaternion<T> rotation;
};

// The mean must have z > 0 in camera axes; the caller culls the others.
template <class T>
PEPESEG_HD Projection<T> Project(const ProjectionCamera<T>& camera, const GaussianShape<T>& shape) {
  Projection<T> out;
  out.mean_in_cam = MeanInCam(camera, shape.mean);
  const T inv_z = T(1) / out.mean_in_cam.z;
  out.x = camera.fx * out.mean_in_cam.x * inv_z + camera.cx;
  out.y = camera.fy * out.mean_in_cam.y * inv_z + camera.cy;
  const Vec3<T> scale = {Exp(shape.log_scale.x), Exp(shape.log_scale.y), Exp(shape.log_scale.z)};
  const ProjectedAxes<T> axes =
      ProjectAxes(camera, out.mean_in_cam, RotationFromQuaternion(shape.rotation));
  const Vec3<T> u0 = Scale(axes.row0, scale), u1 = Scale(axes.row1, scale);
  const T xx = Dot(u0, u0), xy = Dot(u0, u1), yy = Dot(u1, u1);
  // det(U U^T) = |u0 x u1|^2, which does not cancel for a needle and is positive when dilated.
  const Vec3<T> cross = Cross(u0, u1);
  const T dilation = T(kDilation);
  out.determinant = Dot(cross, cross) + dilation * (xx + yy) + dilation * dilation;
  const T inv_det = T(1) / out.determinant;
  out.conic = {(yy + dilation) * inv_det, T(0) - xy * inv_det, (xx + dilation) * inv_det};
  return out;
}

// Gradients of the outputs of Project.
template <class T>
struct ProjectionGrad {
  T x, y;
  Sym2<T> conic;  // of the three numbers; that of xy counts both off-diagonal elements
  T depth;        // of mean_in_cam.z
};

// Gradients of mean, log scales and quaternion, from those of the projection. Projects again, so
// that nothing has to be kept from the forward pass.
template <class T>
PEPESEG_HD GaussianShape<T> ProjectVjp(const ProjectionCamera<T>& camera,
                                       const GaussianShape<T>& shape,
                                       const ProjectionGrad<T>& grad) {
  const Vec3<T> mean = MeanInCam(camera, shape.mean);
  const T inv_z = T(1) / mean.z;
  const Mat3<T> rotation = RotationFromQuaternion(shape.rotation);
  const Vec3<T> scale = {Exp(shape.log_scale.x), Exp(shape.log_scale.y), Exp(shape.log_scale.z)};
  const ProjectedAxes<T> axes = ProjectAxes(camera, mean, rotation);
  const Vec3<T> u0 = Scale(axes.row0, scale), u1 = Scale(axes.row1, scale);
  const Vec3<T> cross = Cross(u0, u1);
  const T dilation = T(kDilation);
  const T cov_xx = Dot(u0, u0) + dilation, cov_yy = Dot(u1, u1) + dilation;
  const T inv_det = T(1) / (Dot(cross, cross) + dilation * (cov_xx + cov_yy) - dilation * dilation);
  const T cxx = cov_yy * inv_det, cxy = T(0) - Dot(u0, u1) * inv_det, cyy = cov_xx * inv_det;
  // The gradient of the covariance is -C G C, where C is the conic and G its gradient as a
  // symmetric matrix, each off-diagonal element half of grad.conic.xy.
  const T half_xy = T(0.5f) * grad.conic.xy;
  const T gc00 = grad.conic.xx * cxx + half_xy * cxy, gc01 = grad.conic.xx * cxy + half_xy * cyy;
  const T gc10 = half_xy * cxx + grad.conic.yy * cxy, gc11 = half_xy * cxy + grad.conic.yy * cyy;
  // Twice that, as cov = U U^T and so the gradient of U is 2 (-C G C) U.
  const T cov_grad_xx = T(-2) * (cxx * gc00 + cxy * gc10);
  const T cov_grad_xy = T(-2) * (cxx * gc01 + cxy * gc11);
  const T cov_grad_yy = T(-2) * (cxy * gc01 + cyy * gc11);
  const Vec3<T> axes_grad0 = Scale(cov_grad_xx * u0 + cov_grad_xy * u1, scale);
  const Vec3<T> axes_grad1 = Scale(cov_grad_xy * u0 + cov_grad_yy * u1, scale);

  GaussianShape<T> out;
  out.log_scale = Scale(axes_grad0, axes.row0) + Scale(axes_grad1, axes.row1);
  const Mat3<T> rotation_grad = {axes.jw0.x * axes_grad0 + axes.jw1.x * axes_grad1,
                                 axes.jw0.y * axes_grad0 + axes.jw1.y * axes_grad1,
                                 axes.jw0.z * axes_grad0 + axes.jw1.z * axes_grad1};
  out.rotation = RotationFromQuaternionVjp(shape.rotation, rotation_grad);

  // Mean: directly, and through J, which depends on 1 / z and, unless they are clamped, on x / z
  // and y / z.
  const Vec3<T> jw_grad0 = rotation * axes_grad0, jw_grad1 = rotation * axes_grad1;
  const T x = mean.x * inv_z, y = mean.y * inv_z;
  const T fx = camera.fx * inv_z, fy = camera.fy * inv_z;
  const auto x_free = (camera.min_x < x) & (x < camera.max_x);
  const auto y_free = (camera.min_y < y) & (y < camera.max_y);
  const T zero = T(0);
  const T x_grad =
      fx * grad.x - Select(x_free, fx * Dot(jw_grad0, camera.rotation.row2) * inv_z, zero);
  const T y_grad =
      fy * grad.y - Select(y_free, fy * Dot(jw_grad1, camera.rotation.row2) * inv_z, zero);
  const T z_grad = grad.depth - x * x_grad - y * y_grad -
                   inv_z * (Dot(jw_grad0, axes.jw0) + Dot(jw_grad1, axes.jw1));
  out.mean = MulTransposed(camera.rotation, Vec3<T>{x_grad, y_grad, z_grad});
  return out;
}

}  // namespace pepeseg
