#include "core/sfm/mapper/model_gates.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>
#include <set>

#include "core/sfm/mapper/triangulation.h"

namespace pepeseg {
namespace {

constexpr double kRadian = std::numbers::pi / 180;
constexpr double kMaxTurnError = 3, kMaxDirectionError = 10;  // degrees
constexpr double kLeastAngle = 2;                             // degrees
constexpr int kSharedPoints = 30;
// Features are found as precisely as a photograph is sharp, and large ones are seldom sharp to a
// pixel: errors count in pixels of a photograph that was shrunk to this longer side.
constexpr double kSharpSide = 1000;
// Two photographs should share a point if they look at it from directions this close, and from
// distances that differ by less than this factor: within SIFT's reach.
constexpr double kMatchableAngle = 20 * kRadian;
constexpr double kMatchableScale = 1.5;

double Quantile(std::vector<double>& values, double share) {
  if (values.empty()) return INFINITY;
  const auto k = static_cast<size_t>(share * static_cast<double>(values.size() - 1));
  std::nth_element(values.begin(), values.begin() + static_cast<ptrdiff_t>(k), values.end());
  return values[k];
}

double Share(size_t part, size_t whole) {
  return whole == 0 ? 1 : static_cast<double>(part) / static_cast<double>(whole);
}

void MeasureTracks(std::span<const MapperPhotograph> photographs, const GlobalModel& model,
                   std::span<const Track> tracks, ModelMeasures& measures) {
  std::map<Observation, const MappedPoint*> point_of;
  for (const MappedPoint& point : model.points) {
    for (const Observation& o : point.track) point_of[o] = &point;
  }
  std::vector<double> errors;
  size_t num_in_front = 0;
  for (const Track& track : tracks) {
    const MappedPoint* point = nullptr;
    for (const Observation& o : track) {
      const auto found = point_of.find(o);
      if (found != point_of.end()) point = found->second;
      if (point) break;
    }
    if (!point) continue;
    for (const Observation& o : track) {
      const CameraPose& pose = model.poses[o.photograph];
      if (!pose.is_registered) continue;
      num_in_front += pose.ToCamera(point->position).z() > 0;
      const MapperPhotograph& photograph = photographs[o.photograph];
      const double pixel =
          std::max(1.0, std::max(photograph.width, photograph.height) / kSharpSide);
      errors.push_back(ReprojectionError(photographs, model, point->position, o) / pixel);
    }
  }
  measures.in_front_share = Share(num_in_front, errors.size());
  measures.median_error = Quantile(errors, 0.5);
  measures.error_90 = Quantile(errors, 0.9);
}

// Returns whether a relative pose is that of the model.
bool Agrees(const CameraPose& a, const CameraPose& b, const ViewPose& view) {
  const Eigen::Matrix3d turn = b.rotation * a.rotation.transpose();
  if (RotationAngle(view.pose.rotation.transpose() * turn) > kMaxTurnError * kRadian) return false;
  if (!view.has_direction) return true;
  const Eigen::Vector3d direction = b.rotation * (a.Centre() - b.Centre());
  return std::atan2(direction.cross(view.pose.translation).norm(),
                    direction.dot(view.pose.translation)) < kMaxDirectionError * kRadian;
}

void MeasurePairs(const GlobalModel& model, std::span<const ViewEdge> edges,
                  ModelMeasures& measures) {
  size_t num_inliers = 0, num_agreeing = 0;
  for (const ViewEdge& edge : edges) {
    const CameraPose &a = model.poses[edge.first], &b = model.poses[edge.second];
    if (!a.is_registered || !b.is_registered) continue;
    const bool agrees = Agrees(a, b, edge.view) ||
                        std::any_of(edge.others.begin(), edge.others.end(),
                                    [&](const ViewPose& other) { return Agrees(a, b, other); });
    num_inliers += edge.view.inliers.size();
    num_agreeing += agrees ? edge.view.inliers.size() : 0;
  }
  measures.agreeing_pairs = Share(num_agreeing, num_inliers);
}

// Counts for each pair of photographs the points of one that the other should see, too.
void MeasureSharing(std::span<const MapperPhotograph> photographs, const GlobalModel& model,
                    std::span<const ViewEdge> edges, std::span<const PhotographIndices> compared,
                    ModelMeasures& measures) {
  std::set<PhotographIndices> matched, tried;
  for (const ViewEdge& edge : edges) matched.insert(std::minmax(edge.first, edge.second));
  for (const auto& [first, second] : compared) tried.insert(std::minmax(first, second));
  std::map<std::pair<uint32_t, uint32_t>, int> shared;
  for (const MappedPoint& point : model.points) {
    for (uint32_t i = 0; i < photographs.size(); ++i) {
      const CameraPose& pose = model.poses[i];
      if (!pose.is_registered) continue;
      const Eigen::Vector3d seen = pose.ToCamera(point.position);
      if (seen.z() <= 0) continue;
      const Eigen::Vector2d pixel = model.lenses[photographs[i].camera_group].Project(seen);
      if (pixel.x() < 0 || pixel.y() < 0 || pixel.x() > photographs[i].width ||
          pixel.y() > photographs[i].height) {
        continue;
      }
      const Eigen::Vector3d ray = point.position - pose.Centre();
      for (const Observation& o : point.track) {
        if (o.photograph == i) continue;
        const Eigen::Vector3d other = point.position - model.poses[o.photograph].Centre();
        const double ratio = ray.norm() / other.norm();
        if (std::atan2(ray.cross(other).norm(), ray.dot(other)) < kMatchableAngle &&
            ratio < kMatchableScale && ratio > 1 / kMatchableScale) {
          ++shared[std::minmax(i, o.photograph)];
        }
      }
    }
  }
  size_t num_pairs = 0, num_matched = 0;
  for (const auto& [pair, count] : shared) {
    if (count < kSharedPoints || (!tried.empty() && !tried.contains(pair))) continue;
    ++num_pairs;
    num_matched += matched.count(pair);
  }
  measures.matched_share = Share(num_matched, num_pairs);
}

}  // namespace

std::string_view GateName(MapperGate gate) {
  switch (gate) {
    case MapperGate::kPassed:
      return "passed";
    case MapperGate::kTooFew:
      return "too few connected photographs";
    case MapperGate::kTurn:
      return "photographs from one spot";
    case MapperGate::kFocal:
      return "focal length not determined";
    case MapperGate::kPositions:
      return "positions not determined";
    case MapperGate::kRegistered:
      return "photographs that match others lack a pose";
    case MapperGate::kReprojection:
      return "large reprojection errors";
    case MapperGate::kPairs:
      return "pairs disagree with the poses";
    case MapperGate::kLens:
      return "implausible lens";
    case MapperGate::kAngles:
      return "small angles between rays";
    case MapperGate::kInFront:
      return "points behind cameras";
    case MapperGate::kFolded:
      return "different places merged";
  }
  return "unknown";
}

ModelMeasures MeasureModel(std::span<const MapperPhotograph> photographs, const GlobalModel& model,
                           std::span<const ViewEdge> edges, std::span<const Track> tracks,
                           std::span<const PhotographIndices> compared) {
  ModelMeasures measures;
  std::vector<bool> matches(photographs.size(), false);
  for (const ViewEdge& edge : edges) matches[edge.first] = matches[edge.second] = true;
  size_t num_matching = 0, num_registered = 0;
  measures.least_focal = INFINITY;
  for (size_t i = 0; i < photographs.size(); ++i) {
    num_matching += matches[i];
    if (!model.poses[i].is_registered) continue;
    num_registered += matches[i];
    const GroupLens& lens = model.lenses[photographs[i].camera_group];
    const double focal = lens.focal / std::max(lens.width, lens.height);
    measures.least_focal = std::min(measures.least_focal, focal);
    measures.most_focal = std::max(measures.most_focal, focal);
    measures.most_k1 = std::max(measures.most_k1, std::abs(lens.k1));
  }
  measures.registered_share = Share(num_registered, num_matching);
  MeasureTracks(photographs, model, tracks, measures);
  MeasurePairs(model, edges, measures);
  const auto wide = std::count_if(
      model.points.begin(), model.points.end(),
      [&](const MappedPoint& point) { return LargestAngle(model, point) >= kLeastAngle; });
  measures.angle_share = Share(static_cast<size_t>(wide), model.points.size());
  MeasureSharing(photographs, model, edges, compared, measures);
  return measures;
}

MapperGate JudgeMeasures(const ModelMeasures& m) {
  if (!(m.registered_share >= 1)) return MapperGate::kRegistered;
  if (!(m.least_focal >= 0.4 && m.most_focal <= 3 && m.most_k1 < 0.3)) return MapperGate::kLens;
  if (!(m.in_front_share >= 0.98)) return MapperGate::kInFront;
  if (!(m.median_error < 1 && m.error_90 < 2.5)) return MapperGate::kReprojection;
  if (!(m.agreeing_pairs >= 0.85)) return MapperGate::kPairs;
  if (!(m.angle_share >= 0.5)) return MapperGate::kAngles;
  if (!(m.matched_share >= 0.7) || m.contradicted_pairs > 0) return MapperGate::kFolded;
  return MapperGate::kPassed;
}

}  // namespace pepeseg
