#include "core/reconstruct/free_space.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <utility>

#include "core/base/order_statistics.h"

namespace pepeseg {
namespace {

// Radii, in distances of the nearest points: of a half ball, and of a ball of which only what at
// most one photograph shows is free.
constexpr double kShareOfNearest = 0.5, kHardlySeenShare = 0.75;
// Share of the points in front of a camera that may be nearer: points of poor matches.
constexpr size_t kStrayOf = 200;      // one of 200
constexpr size_t kMostPoints = 4096;  // that are looked at for a camera, evenly spread
constexpr int kMostCells = 64;        // of the grid, along an axis
// Cameras halfway between a camera and its nearest neighbours, where a camera was carried, too.
constexpr size_t kNeighbors = 3;
constexpr double kLeastCosine = 0.5;  // between the directions of two neighbours

// Returns the distance of the nearest points in front of a camera, wherever they are: also those
// that its photograph does not show. 0 without any.
double NearestPoint(const Pose& cam_from_world, const std::vector<ScenePoint>& points) {
  std::vector<double> distances;
  const size_t stride = (points.size() + kMostPoints - 1) / kMostPoints;
  for (size_t i = 0; i < points.size(); i += stride) {
    const Eigen::Vector3d in_camera = cam_from_world * points[i].position.cast<double>();
    if (in_camera.z() > 0) distances.push_back(in_camera.norm());
  }
  return distances.empty() ? 0 : ValueAtRank(distances, distances.size() / kStrayOf);
}

// Returns the direction in which a camera looks.
Eigen::Vector3d DirectionOf(const Pose& world_from_cam) {
  return (world_from_cam.rotation * Eigen::Vector3d::UnitZ()).normalized();
}

// Returns world_from_cam of the training views, then of cameras halfway between each of them and
// its nearest neighbours that look the same way.
std::vector<Pose> Cameras(const Capture& capture) {
  std::vector<Pose> cameras;
  for (const View& view : capture.views) {
    if (!view.held_out) cameras.push_back(view.cam_from_world.Inverse());
  }
  const size_t num_views = cameras.size();
  for (size_t i = 0; i < num_views; ++i) {
    const Pose own = cameras[i];                    // copies, as `cameras` grows
    std::vector<std::pair<double, size_t>> others;  // by distance
    for (size_t j = 0; j < num_views; ++j) {
      if (j != i) others.emplace_back((cameras[j].translation - own.translation).norm(), j);
    }
    const size_t count = std::min(kNeighbors, others.size());
    std::partial_sort(others.begin(), others.begin() + static_cast<ptrdiff_t>(count), others.end());
    for (size_t k = 0; k < count; ++k) {
      const Pose other = cameras[others[k].second];
      if (DirectionOf(own).dot(DirectionOf(other)) < kLeastCosine) continue;
      cameras.push_back(
          {own.rotation.slerp(0.5, other.rotation), (own.translation + other.translation) / 2});
    }
  }
  return cameras;
}

}  // namespace

FreeSpace::FreeSpace(const Capture& capture, double clearance) {
  if (clearance <= 0) return;
  for (const View& view : capture.views) {
    if (!view.held_out) views_.push_back(ToPinholeView(view.camera, view.cam_from_world));
  }
  const double most = clearance * SceneRadius(capture);
  const std::vector<Pose> cameras = Cameras(capture);
  for (size_t i = 0; i < cameras.size(); ++i) {
    const double nearest = NearestPoint(cameras[i].Inverse(), capture.points);
    if (!(nearest > 0)) continue;
    const Eigen::Vector3f center = cameras[i].translation.cast<float>();
    const Eigen::Vector3f forward = DirectionOf(cameras[i]).cast<float>();
    const auto add = [&](double share, bool is_half) {
      const double radius = std::min(most, share * nearest);
      balls_.push_back({center, forward, static_cast<float>(radius), is_half});
    };
    add(kShareOfNearest, true);
    const bool is_halfway = i >= views_.size();
    if (!is_halfway) add(kHardlySeenShare, false);
  }
  if (!balls_.empty()) MakeGrid();
}

// A cell is as large as the largest ball where that gives no more than kMostCells along an axis, so
// that a ball reaches few cells, and a cell has few balls.
void FreeSpace::MakeGrid() {
  Eigen::Vector3f low = balls_[0].center, high = low;
  float largest = 0;
  for (const Ball& ball : balls_) {
    low = low.cwiseMin((ball.center.array() - ball.radius).matrix());
    high = high.cwiseMax((ball.center.array() + ball.radius).matrix());
    largest = std::max(largest, ball.radius);
  }
  corner_ = low;
  cell_size_ = std::max(largest, (high - low).maxCoeff() / kMostCells);
  int64_t count = 1;
  for (int axis = 0; axis < 3; ++axis) {
    num_cells_[axis] = static_cast<int>((high[axis] - low[axis]) / cell_size_) + 1;
    count *= num_cells_[axis];
  }
  std::vector<std::vector<int32_t>> of_cell(static_cast<size_t>(count));
  for (size_t i = 0; i < balls_.size(); ++i) {
    std::array<int, 3> from{}, to{};
    for (int axis = 0; axis < 3; ++axis) {
      const auto cell = [&](float at) {
        const int index = static_cast<int>((at - corner_[axis]) / cell_size_);
        return std::clamp(index, 0, num_cells_[axis] - 1);
      };
      from[axis] = cell(balls_[i].center[axis] - balls_[i].radius);
      to[axis] = cell(balls_[i].center[axis] + balls_[i].radius);
    }
    for (int z = from[2]; z <= to[2]; ++z) {
      for (int y = from[1]; y <= to[1]; ++y) {
        for (int x = from[0]; x <= to[0]; ++x) {
          of_cell[(int64_t{z} * num_cells_[1] + y) * num_cells_[0] + x].push_back(
              static_cast<int32_t>(i));
        }
      }
    }
  }
  cell_first_.push_back(0);
  for (const std::vector<int32_t>& balls : of_cell) {
    ball_of_.insert(ball_of_.end(), balls.begin(), balls.end());
    cell_first_.push_back(static_cast<int32_t>(ball_of_.size()));
  }
}

int64_t FreeSpace::CellOf(const Eigen::Vector3f& point) const {
  std::array<int64_t, 3> cell{};
  for (int axis = 0; axis < 3; ++axis) {
    const float at = (point[axis] - corner_[axis]) / cell_size_;
    // Also false for NaN.
    if (!(at >= 0 && at < static_cast<float>(num_cells_[axis]))) return -1;
    cell[axis] = static_cast<int64_t>(at);
  }
  return (cell[2] * num_cells_[1] + cell[1]) * num_cells_[0] + cell[0];
}

// Returns whether at most one photograph shows the point, which other things may hide.
bool FreeSpace::IsHardlySeen(const Eigen::Vector3f& point) const {
  int num_views = 0;
  for (const PinholeView& view : views_) {
    const Eigen::Map<const Eigen::Matrix<float, 3, 4, Eigen::RowMajor>> cam_from_world(
        view.cam_from_world);
    const Eigen::Vector3f in_camera = cam_from_world * point.homogeneous();
    if (!(in_camera.z() > 0)) continue;
    const float x = view.fx * in_camera.x() / in_camera.z() + view.cx;
    const float y = view.fy * in_camera.y() / in_camera.z() + view.cy;
    const bool shows = x >= 0 && y >= 0 && x < static_cast<float>(view.width) &&
                       y < static_cast<float>(view.height);
    if (shows && ++num_views > 1) return false;
  }
  return true;
}

bool FreeSpace::Contains(const Eigen::Vector3f& point) const {
  if (empty()) return false;
  const int64_t cell = CellOf(point);
  if (cell < 0) return false;
  bool is_near = false;
  for (int32_t k = cell_first_[cell]; k < cell_first_[cell + 1]; ++k) {
    const Ball& ball = balls_[ball_of_[k]];
    const Eigen::Vector3f away = point - ball.center;
    if (!(away.squaredNorm() < ball.radius * ball.radius)) continue;
    if (ball.is_half && away.dot(ball.forward) > 0) return true;
    is_near |= !ball.is_half;
  }
  return is_near && IsHardlySeen(point);
}

}  // namespace pepeseg
