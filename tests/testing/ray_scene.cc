#include "tests/testing/ray_scene.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <string>

namespace pepeseg::testing {
namespace {

using Eigen::Vector3d;

std::optional<Hit> MeetBall(const Surface& ball, const Ray& ray) {
  const Vector3d to_origin = ray.origin - ball.center;
  const double a = ray.direction.squaredNorm();
  const double b = to_origin.dot(ray.direction);
  const double c = to_origin.squaredNorm() - ball.half.x() * ball.half.x();
  const double discriminant = b * b - a * c;
  if (discriminant <= 0) return std::nullopt;
  const double t = (-b - std::sqrt(discriminant)) / a;
  if (t <= 0) return std::nullopt;
  return Hit{t, (to_origin + t * ray.direction).normalized(), &ball};
}

std::optional<Hit> MeetBox(const Surface& box, const Ray& ray) {
  const Vector3d to_center = box.axes_from_world * (box.center - ray.origin);
  const Vector3d direction = box.axes_from_world * ray.direction;
  double near = 0, far = std::numeric_limits<double>::infinity();
  Vector3d normal = Vector3d::Zero();
  for (int axis = 0; axis < 3; ++axis) {
    const double inverse = 1 / direction[axis];
    const double middle = to_center[axis] * inverse;
    const double reach = box.half[axis] * std::abs(inverse);
    if (middle - reach > near) {
      near = middle - reach;
      normal = Vector3d::Unit(axis) * (direction[axis] > 0 ? -1.0 : 1.0);
    }
    far = std::min(far, middle + reach);
  }
  if (near >= far || near <= 0) return std::nullopt;
  return Hit{near, box.axes_from_world.transpose() * normal, &box};
}

// Tests only the ball around the surface. True: the ray misses it, and Trace can skip it.
bool PassesBy(const Surface& surface, const Ray& ray) {
  const double distance = (surface.center - ray.origin).cross(ray.direction).squaredNorm();
  return distance > surface.half.squaredNorm() * ray.direction.squaredNorm();
}

// Returns the colour in [0, 1] of a hit; dark for the sky.
Vector3d Shade(const Ray& ray, const Hit& hit) {
  if (hit.surface == nullptr) return {0.1, 0.1, 0.12};
  const Vector3d x = ray.origin + hit.distance * ray.direction;
  const double wave = std::sin(9 * x.x()) * std::cos(8 * x.z() + 7 * x.y());
  const double texture = 0.85 + hit.surface->contrast * wave;
  const double light = 0.55 + 0.45 * std::max(0.0, hit.normal.dot(Vector3d(-0.4, -0.8, -0.45)));
  return (hit.surface->color * texture * light).cwiseMin(1.0);
}

Pose LookAt(const Vector3d& eye, const Vector3d& target) {
  const Vector3d forward = (target - eye).normalized();
  const Vector3d right = Vector3d::UnitY().cross(forward).normalized();
  Eigen::Matrix3d rotation;  // rows: the camera's axes in the world
  rotation.row(0) = right;
  rotation.row(1) = forward.cross(right);
  rotation.row(2) = forward;
  const Eigen::Quaterniond quaternion(rotation);
  return {quaternion, -(quaternion * eye)};
}

}  // namespace

Hit Trace(std::span<const Surface> surfaces, const Ray& ray) {
  Hit nearest;
  for (const Surface& surface : surfaces) {
    if (PassesBy(surface, ray)) continue;
    const auto hit = surface.is_ball ? MeetBall(surface, ray) : MeetBox(surface, ray);
    if (hit && hit->distance < nearest.distance) nearest = *hit;
  }
  return nearest;
}

Ray PixelRay(const View& view, double x, double y) {
  const Camera& camera = view.camera;
  const Pose world_from_cam = view.cam_from_world.Inverse();
  const Vector3d in_cam((x - camera.cx) / camera.fx, (y - camera.cy) / camera.fy, 1);
  return {world_from_cam.translation, world_from_cam.rotation * in_cam};
}

View PlaceView(const ViewArc& arc, int index) {
  View view;
  view.name = "view_" + std::to_string(100 + index) + ".png";
  const double focal = 1.1 * arc.width;
  view.camera = {
      arc.width, arc.height, focal, focal, arc.width / 2.0 + 0.7, arc.height / 2.0 - 0.4};
  const double share = arc.num_views > 1 ? double(index) / (arc.num_views - 1) : 0.5;
  const double angle = (share - 0.5) * arc.angle;
  const double height = 1.2 + 0.4 * (index % 3);
  const Vector3d eye = {arc.distance * std::sin(angle), -height, -arc.distance * std::cos(angle)};
  view.cam_from_world = LookAt(eye, arc.target);
  view.held_out = arc.held_out_every > 0 && index % arc.held_out_every == 0;
  return view;
}

Image Photograph(std::span<const Surface> surfaces, const View& view) {
  Image photo = {view.camera.width, view.camera.height, 3, {}};
  photo.pixels.reserve(size_t(3) * photo.width * photo.height);
  for (int y = 0; y < photo.height; ++y) {
    for (int x = 0; x < photo.width; ++x) {
      Vector3d sum = Vector3d::Zero();
      for (int k = 0; k < 4; ++k) {
        const double u = k % 2 == 0 ? 0.25 : 0.75, v = k < 2 ? 0.25 : 0.75;
        const Ray ray = PixelRay(view, x + u, y + v);
        sum += Shade(ray, Trace(surfaces, ray));
      }
      for (int c = 0; c < 3; ++c) photo.pixels.push_back(uint8_t(std::lround(sum[c] / 4 * 255)));
    }
  }
  return photo;
}

std::vector<Hit> TraceCenters(std::span<const Surface> surfaces, const View& view) {
  std::vector<Hit> hits;
  hits.reserve(size_t(view.camera.width) * view.camera.height);
  for (int y = 0; y < view.camera.height; ++y) {
    for (int x = 0; x < view.camera.width; ++x) {
      hits.push_back(Trace(surfaces, PixelRay(view, x + 0.5, y + 0.5)));
    }
  }
  return hits;
}

std::vector<ScenePoint> SurfacePoints(std::span<const Surface> surfaces, const Capture& capture,
                                      int num_points) {
  std::vector<ScenePoint> points;
  for (int i = 0; static_cast<int>(points.size()) < num_points; ++i) {
    const View& view = capture.views[i % capture.views.size()];
    const double u = std::fmod(0.5 + 0.7548776662466927 * i, 1.0);  // a low-discrepancy sequence
    const double v = std::fmod(0.5 + 0.5698402909980532 * i, 1.0);
    const Ray ray = PixelRay(view, u * view.camera.width, v * view.camera.height);
    const Hit hit = Trace(surfaces, ray);
    if (hit.surface == nullptr) continue;
    ScenePoint point;
    point.position = (ray.origin + hit.distance * ray.direction).cast<float>();
    const Vector3d color = Shade(ray, hit);
    for (int c = 0; c < 3; ++c) point.rgb[c] = uint8_t(std::lround(color[c] * 255));
    points.push_back(point);
  }
  return points;
}

}  // namespace pepeseg::testing
