#include "core/dataset/capture_checks.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"

namespace pepeseg {
namespace {

constexpr size_t kMostCameras = 200, kMostPoints = 2000;  // that are examined, evenly spread
constexpr size_t kFewestPoints = 20;                      // that allow a verdict
constexpr double kFits = 0.25;  // share of the points that cameras see where poses fit them
constexpr double kFarMore = 4;  // times as many as with the poses as written

// Returns the step between elements so that at most `most` of them are examined.
size_t StepOf(size_t num, size_t most) { return std::max<size_t>(1, (num + most - 1) / most); }

// Half a turn about x: y down and z forward become y up and z backwards, and back.
Pose Turned(const Pose& pose) {
  const Eigen::Quaterniond turn(0, 1, 0, 0);
  return {turn * pose.rotation, turn * pose.translation};
}
Pose Inverse(const Pose& pose) { return pose.Inverse(); }
// The pose in a world with the other axes.
Pose OfTurnedWorld(const Pose& pose) {
  return {pose.rotation * Eigen::Quaterniond(0, 1, 0, 0), pose.translation};
}

Pose TurnedInverse(const Pose& pose) { return Turned(Inverse(pose)); }
// transforms.json with cam_from_world in place of world_from_cam. As written, w = F m^-1 was read
// from the matrix m = F c of the true pose c, so that c = F m and m = w^-1 F.
Pose InverseOfOpenGl(const Pose& pose) { return Turned(OfTurnedWorld(Inverse(pose))); }
Pose InverseOfOpenCv(const Pose& pose) { return OfTurnedWorld(Inverse(pose)); }

// Returns the share of the points that a camera sees, mean over the cameras. The distortion of the
// lens is left out.
template <class Correct>
double SeenShare(std::span<const PosedLens> cameras, std::span<const ScenePoint> points,
                 const Correct& correct) {
  int64_t num = 0, num_seen = 0;
  for (size_t i = 0; i < cameras.size(); i += StepOf(cameras.size(), kMostCameras)) {
    const PosedLens camera = {cameras[i].lens, correct(cameras[i].cam_from_world)};
    for (size_t k = 0; k < points.size(); k += StepOf(points.size(), kMostPoints)) {
      ++num;
      num_seen += Project(camera, points[k].position.cast<double>()).has_value();
    }
  }
  return num > 0 ? static_cast<double>(num_seen) / static_cast<double>(num) : 1;
}

std::vector<PoseConvention> ConventionsOf(PoseFormat format) {
  if (format == PoseFormat::kTransformsJson) {
    return {{"OpenCV's camera axes (x right, y down, z forward), not OpenGL's", 0, 0, Turned},
            {"cam_from_world (world to camera), not world_from_cam", 0, 0, InverseOfOpenGl},
            {"cam_from_world (world to camera) with OpenCV's camera axes", 0, 0, InverseOfOpenCv}};
  }
  if (format == PoseFormat::kColmap) {
    return {{"OpenGL's camera axes (x right, y up, z backwards), not COLMAP's", 0, 0, Turned},
            {"world_from_cam (camera to world), not cam_from_world", 0, 0, Inverse},
            {"world_from_cam (camera to world) with OpenGL's camera axes", 0, 0, TurnedInverse}};
  }
  return {{"camera axes that are turned by half a turn about x", 0, 0, Turned}};
}

double AsWritten(std::span<const PosedLens> cameras, std::span<const ScenePoint> points) {
  return SeenShare(cameras, points, [](const Pose& pose) { return pose; });
}

}  // namespace

std::optional<Eigen::Vector2d> Project(const PosedLens& camera, const Eigen::Vector3d& point) {
  const Eigen::Vector3d at = camera.cam_from_world * point;
  if (!(at.z() > 0)) return std::nullopt;
  const Eigen::Vector2d pixel(camera.lens.fx * at.x() / at.z() + camera.lens.cx,
                              camera.lens.fy * at.y() / at.z() + camera.lens.cy);
  const bool inside = pixel.x() >= 0 && pixel.x() < camera.lens.width && pixel.y() >= 0 &&
                      pixel.y() < camera.lens.height;
  return inside ? std::optional(pixel) : std::nullopt;
}

std::optional<PoseConvention> FindConvention(PoseFormat format, std::span<const PosedLens> cameras,
                                             std::span<const ScenePoint> points) {
  if (points.size() < kFewestPoints) return std::nullopt;
  const double as_written = AsWritten(cameras, points);
  std::optional<PoseConvention> best;
  for (PoseConvention& convention : ConventionsOf(format)) {
    convention.seen = SeenShare(cameras, points, convention.corrected);
    convention.as_written = as_written;
    const bool fits = convention.seen >= kFits && convention.seen > kFarMore * as_written;
    if (fits && (!best || convention.seen > best->seen)) best = convention;
  }
  return best;
}

std::optional<std::string> WarnOfUnseenPoints(std::span<const PosedLens> cameras,
                                              std::span<const ScenePoint> points) {
  constexpr double kNone = 0.002;
  if (points.size() < kFewestPoints) return std::nullopt;
  const double seen = AsWritten(cameras, points);
  if (seen >= kNone) return std::nullopt;
  return absl::StrFormat(
      "the poses do not fit the points: a camera sees %.1f %% of them. Check the convention of the "
      "poses, and whether the points are in the same coordinates",
      100 * seen);
}

std::optional<std::string> WarnOfAxesTurnedAway(PoseFormat format,
                                                std::span<const PosedLens> cameras,
                                                std::span<const ScenePoint> points) {
  constexpr size_t kFewestCameras = 5;
  constexpr double kParallel = 0.02;   // least eigenvalue; 1/3 for axes in all directions
  constexpr double kMostMissed = 0.3;  // distance to the axes, of that to the cameras
  constexpr double kBehind = 0.9;
  if (points.size() >= kFewestPoints || cameras.size() < kFewestCameras) return std::nullopt;
  // The least squares of the distances to the axes.
  const auto num = static_cast<double>(cameras.size());
  Eigen::Matrix3d sum = Eigen::Matrix3d::Zero();
  Eigen::Vector3d side = Eigen::Vector3d::Zero();
  const auto centre_of = [](const PosedLens& camera) {
    return camera.cam_from_world.Inverse().translation;
  };
  const auto axis_of = [](const PosedLens& camera) -> Eigen::Vector3d {
    return camera.cam_from_world.rotation.conjugate() * Eigen::Vector3d::UnitZ();
  };
  for (const PosedLens& camera : cameras) {
    const Eigen::Vector3d axis = axis_of(camera);
    const Eigen::Matrix3d across = Eigen::Matrix3d::Identity() - axis * axis.transpose();
    sum += across;
    side += across * centre_of(camera);
  }
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(sum / num);
  if (!(solver.eigenvalues()[0] > kParallel)) return std::nullopt;
  const Eigen::Vector3d meeting = sum.ldlt().solve(side);
  double missed = 0, distance = 0, num_behind = 0;
  for (const PosedLens& camera : cameras) {
    const Eigen::Vector3d to = meeting - centre_of(camera);
    const double along = axis_of(camera).dot(to);
    missed += (to - along * axis_of(camera)).norm();
    distance += std::abs(along);
    num_behind += along < 0;
  }
  if (missed > kMostMissed * distance || num_behind < kBehind * num) return std::nullopt;
  return absl::StrFormat(
      "the axes of the cameras meet behind %.0f of %.0f of them, and there are no points to check "
      "the poses by. Unless the photographs look outwards from one place, the poses are in another "
      "convention than the format's, such as %s",
      num_behind, num, ConventionsOf(format).front().name);
}

std::optional<std::string> WarnOfIgnoredScene(const Capture& capture, bool has_ignore_masks) {
  int64_t num_pixels = 0, num_ignored = 0, num_points = 0, num_hidden = 0;
  for (const View& view : capture.views) {
    num_pixels += int64_t{view.camera.width} * view.camera.height;
    if (view.ignore.empty()) continue;
    num_ignored += std::ranges::count_if(view.ignore, [](uint8_t value) { return value != 0; });
    Lens lens;
    lens.width = view.camera.width, lens.height = view.camera.height;
    lens.fx = view.camera.fx, lens.fy = view.camera.fy;
    lens.cx = view.camera.cx, lens.cy = view.camera.cy;
    const PosedLens camera = {lens, view.cam_from_world};
    for (size_t k = 0; k < capture.points.size(); k += StepOf(capture.points.size(), kMostPoints)) {
      const auto pixel = Project(camera, capture.points[k].position.cast<double>());
      if (!pixel) continue;
      ++num_points;
      const auto x = static_cast<size_t>(pixel->x()), y = static_cast<size_t>(pixel->y());
      num_hidden += view.ignore[y * static_cast<size_t>(view.camera.width) + x] != 0;
    }
  }
  // Transparent pixels alone: a thing on a large empty background is usual.
  const bool many = has_ignore_masks && 2 * num_ignored > num_pixels;
  if (!many && 2 * num_hidden <= num_points) return std::nullopt;
  const auto percent = [](int64_t part, int64_t whole) {
    return whole > 0 ? 100 * static_cast<double>(part) / static_cast<double>(whole) : 0.0;
  };
  return absl::StrFormat(
      "%.0f %% of the pixels are %s, and with them %.0f %% of the points that the views show: %s",
      percent(num_ignored, num_pixels), has_ignore_masks ? "ignored" : "transparent and ignored",
      percent(num_hidden, num_points),
      has_ignore_masks
          ? "if the ignore masks are turned round, invert them (non-zero is what is left out)"
          : "if the photographs have their alpha turned round, invert it (0 is what is left out)");
}

std::optional<std::string> WarnOfDarkPhotographs(const Capture& capture) {
  constexpr uint8_t kDark = 32;
  constexpr double kFew = 1e-3;  // share of the samples
  int64_t num = 0, num_bright = 0;
  for (const View& view : capture.views) {
    num += static_cast<int64_t>(view.photo.pixels.size());
    num_bright +=
        std::ranges::count_if(view.photo.pixels, [](uint8_t value) { return value > kDark; });
  }
  if (static_cast<double>(num_bright) > kFew * static_cast<double>(num)) return std::nullopt;
  return absl::StrCat("the photographs are nearly black: their values hardly exceed ", kDark,
                      " of 255. If they are 16-bit files of a camera with fewer bits, scale the "
                      "values to the whole range");
}

std::optional<std::string> WarnOfKeepMasks(const Capture& capture) {
  constexpr double kLarge = 0.5;  // share of the pixels
  int num = 0;
  double sum = 0;
  for (const View& view : capture.views) {
    if (view.masks.empty()) continue;
    if (view.masks.num_masks > 1) return std::nullopt;
    ++num;
    sum += static_cast<double>(view.masks.mask_area[0]) /
           (static_cast<double>(view.masks.width) * view.masks.height);
  }
  if (num < 2 || sum <= kLarge * num) return std::nullopt;
  return absl::StrFormat(
      "%d photographs have one mask each, which covers %.0f %% of the pixels on average, and is "
      "taken for a segment. If it says which pixels to use, invert it and put it in ignore/, or "
      "name it in transforms.json (mask_path)",
      num, 100 * sum / num);
}

}  // namespace pepeseg
