#include "tests/core/sfm/mapper/photographed_world.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <map>
#include <numbers>
#include <utility>

#include "core/sfm/mapper/global_positions.h"
#include "core/sfm/two_view/point_pair.h"

namespace pepeseg {
namespace {

void TakePhotographs(World& world, double max_distance, SeededDraws& draws) {
  for (const CameraPose& pose : world.poses) {
    std::vector<Keypoint>& keypoints = world.keypoints.emplace_back();
    std::vector<int>& feature_of = world.feature_of.emplace_back();
    for (const WorldPoint& point : world.points) {
      const Eigen::Vector3d seen = pose.ToCamera(point.position);
      const Eigen::Vector2d pixel = world.lens.Project(seen);
      const bool inside = seen.z() > 0 && seen.norm() < max_distance && pixel.x() > 0 &&
                          pixel.y() > 0 && pixel.x() < World::kWidth && pixel.y() < World::kHeight;
      feature_of.push_back(inside ? static_cast<int>(keypoints.size()) : -1);
      if (!inside) continue;
      keypoints.push_back({static_cast<float>(pixel.x() + draws.Unit() - 0.5),
                           static_cast<float>(pixel.y() + draws.Unit() - 0.5), 1, 0});
    }
  }
  for (const std::vector<Keypoint>& keypoints : world.keypoints) {
    world.photographs.push_back({"", World::kWidth, World::kHeight, 0, 0, keypoints});
  }
}

// Returns the features of a photograph by their looks, without those that look alike.
std::map<int, uint32_t> FeaturesByLook(const World& world, size_t photograph) {
  std::map<int, uint32_t> features;
  std::map<int, int> counts;
  for (size_t p = 0; p < world.points.size(); ++p) {
    const int feature = world.feature_of[photograph][p];
    if (feature < 0) continue;
    features[world.points[p].look] = static_cast<uint32_t>(feature);
    ++counts[world.points[p].look];
  }
  std::erase_if(features, [&](const auto& entry) { return counts[entry.first] > 1; });
  return features;
}

void VerifyPairs(World& world, double false_share, SeededDraws& draws) {
  for (uint32_t a = 0; a < world.poses.size(); ++a) {
    const std::map<int, uint32_t> features = FeaturesByLook(world, a);
    for (uint32_t b = a + 1; b < world.poses.size(); ++b) {
      std::vector<FeatureMatch> matches;
      for (const auto& [look, feature] : FeaturesByLook(world, b)) {
        const auto found = features.find(look);
        if (found != features.end()) matches.push_back({found->second, feature});
      }
      std::vector<Keypoint> second = world.keypoints[b];
      if (draws.Unit() < false_share) {
        // Consistent, but with another pose: the photograph turned by a right angle.
        for (Keypoint& k : second) {
          k = {World::kWidth / 2.0f - (k.y - World::kHeight / 2.0f),
               World::kHeight / 2.0f + (k.x - World::kWidth / 2.0f), 1, 0};
        }
      }
      VerifiedPair pair{a, b, {}};
      const TwoViewCamera camera{World::kWidth, World::kHeight, 0};
      pair.geometry =
          EstimateTwoViewGeometry(world.keypoints[a], second, matches, {camera, camera}, {});
      if (!pair.geometry.inliers.empty()) world.pairs.push_back(std::move(pair));
    }
  }
}

}  // namespace

CameraPose LookAt(const Eigen::Vector3d& centre, const Eigen::Vector3d& target) {
  const Eigen::Vector3d z = (target - centre).normalized();
  const Eigen::Vector3d x = Eigen::Vector3d(0, 1, 0).cross(z).normalized();
  CameraPose pose;
  pose.rotation << x.transpose(), z.cross(x).transpose(), z.transpose();
  pose.translation = -pose.rotation * centre;
  pose.is_registered = true;
  return pose;
}

std::vector<CameraPose> Arc(int count) {
  std::vector<CameraPose> poses;
  for (int i = 0; i < count; ++i) {
    const double angle = 2 * std::numbers::pi / 3 * i / count;
    poses.push_back(LookAt({4 * std::sin(angle), 0.3 * std::sin(5 * angle), -4 * std::cos(angle)},
                           {0.4 * (i % 3 - 1), 0.3 * (i % 2), 0.2 * (i % 4)}));
  }
  return poses;
}

std::vector<WorldPoint> RandomPoints(int count, const Eigen::Vector3d& centre,
                                     const Eigen::Vector3d& reach, int first_look) {
  SeededDraws draws(static_cast<uint64_t>(first_look) + 3);
  std::vector<WorldPoint> points;
  for (int i = 0; i < count; ++i) {
    const double x = draws.Unit(), y = draws.Unit(), z = draws.Unit();
    const Eigen::Vector3d offset(2 * x - 1, 2 * y - 1, 2 * z - 1);
    points.push_back({centre + offset.cwiseProduct(reach), first_look + i});
  }
  return points;
}

World PhotographWorld(std::vector<CameraPose> poses, std::vector<WorldPoint> points, double focal,
                      double false_share, double max_distance) {
  World world;
  world.lens.focal = focal;
  world.poses = std::move(poses);
  world.points = std::move(points);
  SeededDraws draws(4);
  TakePhotographs(world, max_distance, draws);
  VerifyPairs(world, false_share, draws);
  return world;
}

World MakeWorld(std::vector<CameraPose> poses, double focal, double false_share) {
  return PhotographWorld(std::move(poses),
                         RandomPoints(250, Eigen::Vector3d::Zero(), Eigen::Vector3d::Ones()), focal,
                         false_share);
}

MapperResult Map(const World& world, int num_threads) {
  MapperOptions options;
  options.num_threads = num_threads;
  absl::StatusOr<MapperResult> result =
      MapGlobally(world.photographs, world.pairs, options, [](double) { return absl::OkStatus(); });
  EXPECT_TRUE(result.ok()) << result.status();
  return *std::move(result);
}

double CentreError(const World& world, const GlobalModel& model) {
  const Eigen::Matrix3d turn = world.poses[0].rotation.transpose() * model.poses[0].rotation;
  std::vector<Eigen::Vector3d> truth, found;
  std::vector<bool> counts;
  for (size_t i = 0; i < world.poses.size(); ++i) {
    truth.push_back(world.poses[i].Centre());
    found.push_back(turn * model.poses[i].Centre());
    counts.push_back(model.poses[i].is_registered);
  }
  return PositionDifference(truth, found, counts);
}

}  // namespace pepeseg
