#pragma once

#include <Eigen/Core>
#include <vector>

#include "core/sfm/mapper/global_model.h"
#include "core/sfm/mapper/map_globally.h"

// Photographs of points with true poses, and their verified pairs.
namespace pepeseg {

// A point, and what it looks like: features match if their points look alike.
struct WorldPoint {
  Eigen::Vector3d position = Eigen::Vector3d::Zero();
  int look = 0;
};

struct World {
  static constexpr int kWidth = 640, kHeight = 480;

  GroupLens lens{kWidth, kHeight, 600, 0.02};
  std::vector<CameraPose> poses;
  std::vector<WorldPoint> points;
  std::vector<std::vector<Keypoint>> keypoints;
  std::vector<std::vector<int>> feature_of;  // [photograph][point], -1 if not seen
  std::vector<MapperPhotograph> photographs;
  std::vector<VerifiedPair> pairs;
};

// Returns the pose of a camera at `centre` that looks at `target`; y points down.
CameraPose LookAt(const Eigen::Vector3d& centre, const Eigen::Vector3d& target);

// A third of a circle of radius 4 around the origin.
std::vector<CameraPose> Arc(int count);

// Returns random points in the box around `centre` that reaches `reach` to each side, each with a
// look of its own from `first_look` on.
std::vector<WorldPoint> RandomPoints(int count, const Eigen::Vector3d& centre,
                                     const Eigen::Vector3d& reach, int first_look = 0);

// Takes the photographs, with positions off by uniform noise of 0.3 pixels, and verifies all pairs.
// `false_share` of the pairs have a consistent but wrong pose. Points farther than `max_distance`
// are not seen.
World PhotographWorld(std::vector<CameraPose> poses, std::vector<WorldPoint> points,
                      double focal = 600, double false_share = 0, double max_distance = 100);

// Returns a world of 250 points in [-1, 1]^3.
World MakeWorld(std::vector<CameraPose> poses, double focal = 600, double false_share = 0);

// Maps with MapGlobally, which must not fail.
MapperResult Map(const World& world, int num_threads = 1);

// Returns how far the centres are from the truth, see PositionDifference, after the rotation of the
// first photograph is undone.
double CentreError(const World& world, const GlobalModel& model);

}  // namespace pepeseg
