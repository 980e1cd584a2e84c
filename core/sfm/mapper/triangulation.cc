#include "core/sfm/mapper/triangulation.h"

#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>

namespace pepeseg {
namespace {

constexpr double kOneDegree = std::numbers::pi / 180;

struct Ray {
  Observation observation;
  Eigen::Vector3d centre, direction;  // world
};

// Returns the point nearest to two rays, or nothing if they are parallel or meet behind a camera.
std::optional<Eigen::Vector3d> Intersect(const Ray& a, const Ray& b) {
  const Eigen::Vector3d between = b.centre - a.centre;
  const double ab = a.direction.dot(b.direction), determinant = 1 - ab * ab;
  if (!(determinant > 1e-8)) return std::nullopt;
  const double ta = (between.dot(a.direction) - ab * between.dot(b.direction)) / determinant;
  const double tb = (ab * between.dot(a.direction) - between.dot(b.direction)) / determinant;
  if (ta <= 0 || tb <= 0) return std::nullopt;
  return (a.centre + ta * a.direction + b.centre + tb * b.direction) / 2;
}

double Angle(const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
  return std::atan2(a.cross(b).norm(), a.dot(b));
}

// One track's point.
class TrackPoint {
 public:
  TrackPoint(std::span<const MapperPhotograph> photographs, const Track& track,
             const GlobalModel& model, const TriangulationOptions& options)
      : photographs_(photographs), model_(model), options_(options) {
    for (const Observation& o : track) {
      const CameraPose& pose = model.poses[o.photograph];
      if (!pose.is_registered) continue;
      const GroupLens& lens = model.lenses[photographs[o.photograph].camera_group];
      const Eigen::Vector2d u = lens.Normalised(PixelOf(photographs, o));
      rays_.push_back(
          {o, pose.Centre(), (pose.rotation.transpose() * u.homogeneous()).normalized()});
    }
  }

  std::optional<MappedPoint> Find() const {
    std::optional<Eigen::Vector3d> best;
    size_t best_count = 1;
    double best_error = 0;
    for (const auto& [i, j] : Proposals()) {
      const std::optional<Eigen::Vector3d> point = Intersect(rays_[i], rays_[j]);
      if (!point) continue;
      double error = 0;
      const size_t count = Inliers(*point, error).size();
      if (count > best_count || (best && count == best_count && error < best_error)) {
        best = point, best_count = count, best_error = error;
      }
    }
    if (!best) return std::nullopt;
    return Finish(*best);
  }

 private:
  // The pairs of rays with the largest angles among up to 10 rays spread over the track.
  std::vector<std::pair<size_t, size_t>> Proposals() const {
    struct Pair {
      double angle;
      size_t i, j;
    };
    std::vector<Pair> pairs;
    const size_t stride = (rays_.size() + 9) / 10;
    for (size_t i = 0; i < rays_.size(); i += stride) {
      for (size_t j = i + stride; j < rays_.size(); j += stride) {
        const double angle = Angle(rays_[i].direction, rays_[j].direction);
        if (angle > options_.min_angle * kOneDegree) pairs.push_back({angle, i, j});
      }
    }
    std::stable_sort(pairs.begin(), pairs.end(),
                     [](const Pair& a, const Pair& b) { return a.angle > b.angle; });
    std::vector<std::pair<size_t, size_t>> proposals;
    const size_t step = std::max<size_t>(1, pairs.size() / options_.max_proposals);
    for (size_t k = 0; k < pairs.size(); k += step) proposals.emplace_back(pairs[k].i, pairs[k].j);
    return proposals;
  }

  std::vector<size_t> Inliers(const Eigen::Vector3d& point, double& error_sum) const {
    std::vector<size_t> inliers;
    for (size_t i = 0; i < rays_.size(); ++i) {
      const double error = ReprojectionError(photographs_, model_, point, rays_[i].observation);
      if (!(error < options_.max_error)) continue;
      inliers.push_back(i);
      error_sum += error;
    }
    return inliers;
  }

  // Gauss-Newton on the angles between the rays and the point, which are nearly pixels / focal.
  Eigen::Vector3d Refine(Eigen::Vector3d point, const std::vector<size_t>& inliers) const {
    for (int step = 0; step < 3; ++step) {
      Eigen::Matrix3d matrix = Eigen::Matrix3d::Zero();
      Eigen::Vector3d right = Eigen::Vector3d::Zero();
      for (const size_t i : inliers) {
        const Eigen::Matrix3d across =
            Eigen::Matrix3d::Identity() - rays_[i].direction * rays_[i].direction.transpose();
        const double distance = (point - rays_[i].centre).squaredNorm();
        matrix += across / distance;
        right += across * rays_[i].centre / distance;
      }
      const Eigen::Vector3d moved = matrix.ldlt().solve(right);
      if (!moved.allFinite()) return point;
      point = moved;
    }
    return point;
  }

  std::optional<MappedPoint> Finish(const Eigen::Vector3d& start) const {
    double error = 0;
    MappedPoint result;
    result.position = Refine(start, Inliers(start, error));
    for (const size_t i : Inliers(result.position, error)) {
      result.track.push_back(rays_[i].observation);
    }
    if (result.track.size() < 2 || LargestAngle(model_, result) < options_.min_angle) {
      return std::nullopt;
    }
    return result;
  }

  std::span<const MapperPhotograph> photographs_;
  const GlobalModel& model_;
  const TriangulationOptions& options_;
  std::vector<Ray> rays_;
};

}  // namespace

double ReprojectionError(std::span<const MapperPhotograph> photographs, const GlobalModel& model,
                         const Eigen::Vector3d& point, const Observation& observation) {
  const Eigen::Vector3d seen = model.poses[observation.photograph].ToCamera(point);
  if (!(seen.z() > 1e-9)) return INFINITY;
  const GroupLens& lens = model.lenses[photographs[observation.photograph].camera_group];
  return (lens.Project(seen) - PixelOf(photographs, observation)).norm();
}

std::vector<MappedPoint> Triangulate(std::span<const MapperPhotograph> photographs,
                                     std::span<const Track> tracks, const GlobalModel& model,
                                     const TriangulationOptions& options, ThreadPool& pool) {
  std::vector<std::optional<MappedPoint>> found(tracks.size());
  constexpr int64_t kPerTask = 256;
  const auto num_tracks = static_cast<int64_t>(tracks.size());
  pool.ParallelFor((num_tracks + kPerTask - 1) / kPerTask, [&](int64_t task, int) {
    for (int64_t t = task * kPerTask; t < std::min(num_tracks, (task + 1) * kPerTask); ++t) {
      found[t] = TrackPoint(photographs, tracks[t], model, options).Find();
    }
  });
  std::vector<MappedPoint> points;
  for (std::optional<MappedPoint>& point : found) {
    if (point) points.push_back(std::move(*point));
  }
  return points;
}

void FilterPoints(std::span<const MapperPhotograph> photographs, double max_error, double min_angle,
                  GlobalModel& model) {
  for (MappedPoint& point : model.points) {
    std::erase_if(point.track, [&](const Observation& o) {
      return !(ReprojectionError(photographs, model, point.position, o) < max_error);
    });
  }
  std::erase_if(model.points, [&](const MappedPoint& point) {
    return point.track.size() < 2 || LargestAngle(model, point) < min_angle;
  });
}

double LargestAngle(const GlobalModel& model, const MappedPoint& point) {
  std::vector<Eigen::Vector3d> rays;
  for (const Observation& o : point.track) {
    rays.push_back(point.position - model.poses[o.photograph].Centre());
  }
  double largest = 0;
  for (size_t i = 0; i < rays.size(); ++i) {
    for (size_t j = i + 1; j < rays.size(); ++j)
      largest = std::max(largest, Angle(rays[i], rays[j]));
  }
  return largest / kOneDegree;
}

}  // namespace pepeseg
