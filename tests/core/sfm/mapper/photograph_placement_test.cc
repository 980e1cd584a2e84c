#include "core/sfm/mapper/photograph_placement.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <vector>

#include "core/sfm/mapper/absolute_pose.h"
#include "core/sfm/mapper/rotation_averaging.h"
#include "core/sfm/two_view/relative_pose.h"
#include "tests/core/sfm/mapper/photographed_world.h"

namespace pepeseg {
namespace {

std::vector<PointSighting> SightingsFrom(const CameraPose& pose, int count) {
  std::vector<PointSighting> sightings;
  for (const WorldPoint& point : RandomPoints(count, {0, 0, 0}, {1, 1, 1})) {
    const Eigen::Vector3d seen = pose.ToCamera(point.position);
    sightings.push_back({point.position, seen.head<2>() / seen.z()});
  }
  return sightings;
}

double Difference(const CameraPose& a, const CameraPose& b) {
  return RotationAngle(a.rotation.transpose() * b.rotation) + (a.Centre() - b.Centre()).norm();
}

TEST(SolveThreePoints, FindsThePoseAmongPosesThatSeeThePointsWhereTheyAre) {
  for (const CameraPose& pose : Arc(20)) {
    const std::vector<PointSighting> all = SightingsFrom(pose, 3);
    const std::array<PointSighting, 3> sample = {all[0], all[1], all[2]};
    const std::vector<CameraPose> found = SolveThreePoints(sample);
    ASSERT_FALSE(found.empty());
    EXPECT_LE(found.size(), 4u);
    double least = 1;
    for (const CameraPose& candidate : found) {
      least = std::min(least, Difference(pose, candidate));
      for (const PointSighting& sighting : sample) {
        const Eigen::Vector3d seen = candidate.ToCamera(sighting.point);
        EXPECT_LT((seen.head<2>() / seen.z() - sighting.seen).norm(), 1e-5);
      }
    }
    EXPECT_LT(least, 1e-4);
  }
}

TEST(SolveThreePoints, FindsNothingForPointsOnALine) {
  const CameraPose pose = LookAt({0.3, 0.2, -4}, {0, 0, 0});
  std::array<PointSighting, 3> sample;
  for (int i = 0; i < 3; ++i) {
    sample[i].point = {0.2 * i, 0.1 * i, 0.3 * i};
    const Eigen::Vector3d seen = pose.ToCamera(sample[i].point);
    sample[i].seen = seen.head<2>() / seen.z();
  }
  EXPECT_TRUE(SolveThreePoints(sample).empty());
}

TEST(EstimateAbsolutePose, SurvivesSightingsOfWrongPoints) {
  const CameraPose pose = LookAt({1, 0.4, -4}, {0, 0, 0});
  std::vector<PointSighting> sightings = SightingsFrom(pose, 100);
  // Two thirds see another point.
  for (size_t i = 0; i + 1 < sightings.size(); ++i) {
    if (i % 3 != 0) sightings[i].seen = sightings[i + 1].seen;
  }
  const auto found = EstimateAbsolutePose(sightings, {});
  ASSERT_TRUE(found.has_value());
  EXPECT_LT(Difference(pose, found->pose), 1e-3);
  EXPECT_GE(found->inliers.size(), 33u);
}

TEST(EstimateAbsolutePose, NeedsFourSightings) {
  EXPECT_FALSE(EstimateAbsolutePose(SightingsFrom(Arc(3)[1], 3), {}).has_value());
}

// The world's own model, without the pose of one photograph.
GlobalModel ModelWithout(const World& world, uint32_t lost) {
  GlobalModel model{{world.lens}, world.poses, {}};
  model.poses[lost] = {};
  for (size_t p = 0; p < world.points.size(); ++p) {
    MappedPoint point{world.points[p].position, {}};
    for (uint32_t i = 0; i < world.poses.size(); ++i) {
      if (i == lost || world.feature_of[i][p] < 0) continue;
      point.track.push_back({i, static_cast<uint32_t>(world.feature_of[i][p])});
    }
    if (point.track.size() >= 2) model.points.push_back(point);
  }
  return model;
}

TEST(PlacePhotographs, PlacesOneByThePointsThatItShows) {
  const World world = MakeWorld(Arc(10));
  GlobalModel model = ModelWithout(world, 4);
  ThreadPool pool(1);
  EXPECT_EQ(PlacePhotographs(world.photographs, world.pairs, pool, model), 1);
  ASSERT_TRUE(model.poses[4].is_registered);
  EXPECT_LT(Difference(model.poses[4], world.poses[4]), 0.01);
  EXPECT_EQ(PlacePhotographs(world.photographs, world.pairs, pool, model), 0);
}

TEST(PlacePhotographs, LeavesOneThatShowsFewPoints) {
  World world = MakeWorld(Arc(10));
  GlobalModel model = ModelWithout(world, 4);
  for (VerifiedPair& pair : world.pairs) {
    if (pair.first != 4 && pair.second != 4) continue;
    auto& inliers = pair.geometry.inliers;
    inliers.resize(pair.first == 3 || pair.second == 5 ? std::min<size_t>(inliers.size(), 14) : 0);
  }
  ThreadPool pool(1);
  EXPECT_EQ(PlacePhotographs(world.photographs, world.pairs, pool, model), 0);
  EXPECT_FALSE(model.poses[4].is_registered);
}

// All pairs of the photograph say that it was turned on the spot, each by another wrong angle:
// averaging rotations leaves it out.
TEST(MapGlobally, PlacesAPhotographWhosePairsHaveWrongRotations) {
  World world = MakeWorld(Arc(20));
  constexpr uint32_t kLost = 7;
  Eigen::Matrix3d camera;
  camera << 600, 0, World::kWidth / 2.0, 0, 600, World::kHeight / 2.0, 0, 0, 1;
  for (MapperPhotograph& photograph : world.photographs) photograph.focal = 600;
  int count = 0;
  for (VerifiedPair& pair : world.pairs) {
    if (pair.first != kLost && pair.second != kLost) continue;
    ++count;
    pair.geometry.kind = TwoViewKind::kPanoramic;
    pair.geometry.homography =
        camera * RotationFromVector({0.3 * count, 0.2 * (count % 3), 0.1 * (count % 5)}) *
        camera.inverse();
  }
  ASSERT_GT(count, 5);
  ThreadPool pool(1);
  const std::vector<ViewEdge> edges =
      BuildViewGraph(world.photographs, world.pairs, std::vector<GroupLens>{world.lens}, 3, pool);
  ASSERT_FALSE(AverageRotations(20, edges, pool).is_known[kLost]);
  const MapperResult result = Map(world);
  ASSERT_EQ(result.model.poses.size(), 20u);
  EXPECT_TRUE(result.model.poses[kLost].is_registered);
  EXPECT_EQ(result.gate, MapperGate::kPassed) << GateName(result.gate);
  EXPECT_LT(CentreError(world, result.model), 0.005);
}

// Moves the features of all photographs, and with them the principal point.
World ShiftedWorld(const Eigen::Vector2d& shift) {
  World world = MakeWorld(Arc(24));
  for (std::vector<Keypoint>& keypoints : world.keypoints) {
    for (Keypoint& k : keypoints) {
      k.x += static_cast<float>(shift.x());
      k.y += static_cast<float>(shift.y());
    }
  }
  Eigen::Matrix3d move = Eigen::Matrix3d::Identity();
  move.topRightCorner<2, 1>() = shift;
  const Eigen::Matrix3d back = move.inverse();
  for (VerifiedPair& pair : world.pairs) {
    TwoViewGeometry& geometry = pair.geometry;
    geometry.fundamental = (back.transpose() * geometry.fundamental * back).eval();
    geometry.homography = (move * geometry.homography * back).eval();
  }
  return world;
}

TEST(MapGlobally, FindsAPrincipalPointThatIsOffTheCentre) {
  const World world = ShiftedWorld({14, -9});
  const MapperResult result = Map(world);
  EXPECT_EQ(result.gate, MapperGate::kPassed) << GateName(result.gate);
  EXPECT_LT((result.model.lenses[0].shift - Eigen::Vector2d(14, -9)).norm(), 1);
  EXPECT_LT(CentreError(world, result.model), 0.003);
}

TEST(MapGlobally, LeavesAPrincipalPointThatIsAtTheCentre) {
  const MapperResult result = Map(ShiftedWorld({0, 0}));
  EXPECT_EQ(result.gate, MapperGate::kPassed) << GateName(result.gate);
  EXPECT_EQ(result.model.lenses[0].shift, Eigen::Vector2d::Zero().eval());
}

}  // namespace
}  // namespace pepeseg
