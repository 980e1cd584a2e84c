#include "tests/testing/synthetic_capture.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <optional>
#include <string>

namespace pepeseg::testing {
namespace {

using Eigen::Vector3d;

// World: x right, y down, z away from the viewer; the table's top is y = 0.
struct Surface {
  int label;
  bool is_ball;           // else an axis-aligned box
  Vector3d center, half;  // half sizes; for a ball half.x() is the radius
  Vector3d color;
};

const std::array<Surface, 5> kSurfaces = {{
    {0, false, {0, 0.1, 0}, {2, 0.1, 2}, {0.75, 0.65, 0.5}},
    {0, false, {0, -1, 2.1}, {2, 1.2, 0.1}, {0.55, 0.6, 0.7}},
    {kRedBox, false, {-0.8, -0.35, 0.1}, {0.3, 0.35, 0.25}, {0.85, 0.2, 0.15}},
    {kGreenBall, true, {0.05, -0.4, -0.3}, {0.4, 0.4, 0.4}, {0.2, 0.7, 0.25}},
    {kBlueBox, false, {0.85, -0.25, 0.3}, {0.35, 0.25, 0.35}, {0.2, 0.3, 0.85}},
}};

struct Ray {
  Vector3d origin, direction;
};

struct Hit {
  double distance = std::numeric_limits<double>::infinity();
  Vector3d normal = Vector3d::Zero();
  const Surface* surface = nullptr;
};

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
  double near = 0, far = std::numeric_limits<double>::infinity();
  Vector3d normal = Vector3d::Zero();
  for (int axis = 0; axis < 3; ++axis) {
    const double inverse = 1 / ray.direction[axis];
    const double middle = (box.center[axis] - ray.origin[axis]) * inverse;
    const double reach = box.half[axis] * std::abs(inverse);
    if (middle - reach > near) {
      near = middle - reach;
      normal = Vector3d::Unit(axis) * (ray.direction[axis] > 0 ? -1.0 : 1.0);
    }
    far = std::min(far, middle + reach);
  }
  if (near >= far || near <= 0) return std::nullopt;
  return Hit{near, normal, &box};
}

Hit Trace(const Ray& ray) {
  Hit nearest;
  for (const Surface& surface : kSurfaces) {
    const auto hit = surface.is_ball ? MeetBall(surface, ray) : MeetBox(surface, ray);
    if (hit && hit->distance < nearest.distance) nearest = *hit;
  }
  return nearest;
}

// Colour in [0, 1]: a smooth texture fixed to the surface under one lamp; the sky is dark.
Vector3d Shade(const Ray& ray, const Hit& hit) {
  if (hit.surface == nullptr) return {0.1, 0.1, 0.12};
  const Vector3d x = ray.origin + hit.distance * ray.direction;
  const double texture = 0.85 + 0.15 * std::sin(9 * x.x()) * std::cos(8 * x.z() + 7 * x.y());
  const double light = 0.55 + 0.45 * std::max(0.0, hit.normal.dot(Vector3d(-0.4, -0.8, -0.45)));
  return (hit.surface->color * texture * light).cwiseMin(1.0);
}

Ray PixelRay(const View& view, double x, double y) {
  const Camera& camera = view.camera;
  const Pose world_from_cam = view.cam_from_world.Inverse();
  const Vector3d in_cam((x - camera.cx) / camera.fx, (y - camera.cy) / camera.fy, 1);
  return {world_from_cam.translation, world_from_cam.rotation * in_cam};
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

View PlaceView(const SyntheticOptions& options, int index) {
  View view;
  view.name = "view_" + std::to_string(100 + index) + ".png";
  const double focal = 1.1 * options.width;
  view.camera = {options.width,
                 options.height,
                 focal,
                 focal,
                 options.width / 2.0 + 0.7,
                 options.height / 2.0 - 0.4};
  const double share = options.num_views > 1 ? double(index) / (options.num_views - 1) : 0.5;
  const double angle = (share - 0.5) * std::numbers::pi / 2;
  const double height = 1.2 + 0.4 * (index % 3);
  view.cam_from_world = LookAt({4 * std::sin(angle), -height, -4 * std::cos(angle)}, {0, -0.3, 0});
  view.held_out = options.held_out_every > 0 && index % options.held_out_every == 0;
  return view;
}

// Four rays a pixel.
Image Photograph(const View& view) {
  Image photo = {view.camera.width, view.camera.height, 3, {}};
  photo.pixels.reserve(size_t(3) * photo.width * photo.height);
  for (int y = 0; y < photo.height; ++y) {
    for (int x = 0; x < photo.width; ++x) {
      Vector3d sum = Vector3d::Zero();
      for (int k = 0; k < 4; ++k) {
        const double u = k % 2 == 0 ? 0.25 : 0.75, v = k < 2 ? 0.25 : 0.75;
        const Ray ray = PixelRay(view, x + u, y + v);
        sum += Shade(ray, Trace(ray));
      }
      for (int c = 0; c < 3; ++c) photo.pixels.push_back(uint8_t(std::lround(sum[c] / 4 * 255)));
    }
  }
  return photo;
}

std::vector<uint8_t> Labels(const View& view) {
  std::vector<uint8_t> labels;
  for (int y = 0; y < view.camera.height; ++y) {
    for (int x = 0; x < view.camera.width; ++x) {
      const Hit hit = Trace(PixelRay(view, x + 0.5, y + 0.5));
      labels.push_back(hit.surface == nullptr ? uint8_t(0) : uint8_t(hit.surface->label));
    }
  }
  return labels;
}

MaskSet ObjectMasks(const View& view, const std::vector<uint8_t>& labels) {
  std::vector<BinaryMask> masks;
  for (int label = 1; label <= kNumObjects; ++label) {
    BinaryMask mask;
    for (const uint8_t pixel : labels) mask.pixels.push_back(pixel == label ? 1 : 0);
    if (std::count(mask.pixels.begin(), mask.pixels.end(), 1) > 0) masks.push_back(mask);
  }
  return BuildMaskSet(view.camera.width, view.camera.height, masks);
}

// Of the pixels' centres; unknown where there is nothing.
DepthPrior ExactPrior(const View& view, DepthPrior::Kind kind) {
  DepthPrior prior = {kind, {}};
  float min = std::numeric_limits<float>::infinity(), max = -min;
  for (int y = 0; y < view.camera.height; ++y) {
    for (int x = 0; x < view.camera.width; ++x) {
      const Hit hit = Trace(PixelRay(view, x + 0.5, y + 0.5));
      const double z = hit.surface == nullptr ? std::nan("") : hit.distance;
      prior.values.push_back(float(kind == DepthPrior::Kind::kDepth ? z : 1 / z));
      min = std::fmin(min, prior.values.back());
      max = std::fmax(max, prior.values.back());
    }
  }
  for (float& value : prior.values) value = (value - min) / (max - min);
  return prior;
}

// Points at spread-out pixels (a low-discrepancy sequence) of the views in turn.
std::vector<ScenePoint> SurfacePoints(const Capture& capture, int num_points) {
  std::vector<ScenePoint> points;
  for (int i = 0; static_cast<int>(points.size()) < num_points; ++i) {
    const View& view = capture.views[i % capture.views.size()];
    const double u = std::fmod(0.5 + 0.7548776662466927 * i, 1.0);
    const double v = std::fmod(0.5 + 0.5698402909980532 * i, 1.0);
    const Ray ray = PixelRay(view, u * view.camera.width, v * view.camera.height);
    const Hit hit = Trace(ray);
    if (hit.surface == nullptr) continue;
    ScenePoint point;
    point.position = (ray.origin + hit.distance * ray.direction).cast<float>();
    const Vector3d color = Shade(ray, hit);
    for (int c = 0; c < 3; ++c) point.rgb[c] = uint8_t(std::lround(color[c] * 255));
    points.push_back(point);
  }
  return points;
}

}  // namespace

SyntheticScene MakeSyntheticScene(const SyntheticOptions& options) {
  SyntheticScene scene;
  for (int i = 0; i < options.num_views; ++i) {
    View view = PlaceView(options, i);
    view.photo = Photograph(view);
    scene.labels.push_back(Labels(view));
    if (options.depth) view.depth = ExactPrior(view, *options.depth);
    if (options.with_masks) view.masks = ObjectMasks(view, scene.labels.back());
    scene.capture.views.push_back(std::move(view));
  }
  scene.capture.points = SurfacePoints(scene.capture, options.num_points);
  return scene;
}

}  // namespace pepeseg::testing
