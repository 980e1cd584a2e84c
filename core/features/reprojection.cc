#include "core/features/reprojection.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace pepeseg {
namespace {

constexpr double kMaxGridPixels = 65'536;  // depths that are kept of a view, about
// Share of the depth by which a point may miss the depth of a view and still lie on its surface.
constexpr double kDepthTolerance = 0.02;

// Returns the pose that applies `inner`, then `outer`.
Pose Compose(const Pose& outer, const Pose& inner) {
  return {outer.rotation * inner.rotation, outer.rotation * inner.translation + outer.translation};
}

}  // namespace

Reprojection::Reprojection(const Capture& capture, std::span<const int> views)
    : capture_(capture), views_(views.begin(), views.end()), seen_(capture.views.size()) {
  FindNear();
}

void Reprojection::KeepDepth(int number, std::span<const float> depth) {
  Seen& seen = seen_[number];
  const int width = capture_.views[number].camera.width;
  const int height = capture_.views[number].camera.height;
  // Rounded up, so that the grid never exceeds kMaxGridPixels by more than its last row and column.
  seen.stride = std::max(
      1, static_cast<int>(std::ceil(std::sqrt(double{1} * width * height / kMaxGridPixels))));
  seen.depth.clear();
  for (int y = 0; y < height; y += seen.stride) {
    for (int x = 0; x < width; x += seen.stride) {
      seen.depth.push_back(depth[static_cast<size_t>(y) * width + x]);
    }
  }
}

void Reprojection::FindNear() {
  const auto center = [&](int view) -> Eigen::Vector3d {
    return capture_.views[view].cam_from_world.Inverse().translation;
  };
  for (const int view : views_) {
    std::vector<std::pair<double, int>> others;
    for (const int other : views_) {
      if (other == view) continue;
      others.emplace_back((center(other) - center(view)).squaredNorm(), other);
    }
    // Equal distances are ordered by view, so that the result is the same in each run.
    const size_t count = std::min<size_t>(kNearViews, others.size());
    std::partial_sort(others.begin(), others.begin() + static_cast<std::ptrdiff_t>(count),
                      others.end());
    Seen& seen = seen_[view];
    for (size_t i = 0; i < count; ++i) {
      const int near = others[i].second;
      seen.near.push_back(near);
      seen.to_near.push_back(Compose(capture_.views[near].cam_from_world,
                                     capture_.views[view].cam_from_world.Inverse()));
    }
  }
}

float Reprojection::DepthAt(const Seen& seen, const Camera& camera, int x, int y) {
  const int columns = (camera.width + seen.stride - 1) / seen.stride;
  return seen.depth[static_cast<size_t>(y / seen.stride) * columns + x / seen.stride];
}

int32_t Reprojection::PixelAt(int number, const Eigen::Vector3d& in_cam) const {
  const Camera& camera = capture_.views[number].camera;
  if (in_cam.z() <= 0) return kUnknown;
  const double u = camera.fx * in_cam.x() / in_cam.z() + camera.cx;
  const double v = camera.fy * in_cam.y() / in_cam.z() + camera.cy;
  // Written so that NaN is outside.
  if (!(u >= 0 && v >= 0 && u < camera.width && v < camera.height)) return kUnknown;
  // Pixel x covers [x, x + 1): truncation finds it, because centres lie at + 0.5.
  const int x = static_cast<int>(u), y = static_cast<int>(v);
  // A point in front of or behind the surface there is hidden, or the depths disagree.
  const double depth = DepthAt(seen_[number], camera, x, y);
  if (!(std::abs(depth - in_cam.z()) < kDepthTolerance * in_cam.z())) return kUnknown;
  const int32_t pixel = y * camera.width + x;
  const std::vector<uint8_t>& ignore = capture_.views[number].ignore;
  return ignore.empty() || ignore[pixel] == 0 ? pixel : kUnknown;
}

Reprojection::Sight Reprojection::Look(int number, int32_t pixel) const {
  Sight sight;
  sight.fill(kUnknown);
  const Camera& camera = capture_.views[number].camera;
  const Seen& seen = seen_[number];
  const int x = pixel % camera.width, y = pixel / camera.width;
  const double depth = DepthAt(seen, camera, x, y);
  if (depth <= 0) return sight;
  // Depth is z in the camera's frame, scene units.
  const Eigen::Vector3d in_cam = depth * Eigen::Vector3d((x + 0.5 - camera.cx) / camera.fx,
                                                         (y + 0.5 - camera.cy) / camera.fy, 1);
  for (size_t i = 0; i < seen.near.size(); ++i) {
    sight[i] = PixelAt(seen.near[i], seen.to_near[i] * in_cam);
  }
  return sight;
}

}  // namespace pepeseg
