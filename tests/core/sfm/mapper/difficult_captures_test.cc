#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <vector>

#include "core/sfm/mapper/global_positions.h"
#include "core/sfm/mapper/model_gates.h"
#include "core/sfm/mapper/pose_choice.h"
#include "tests/core/sfm/mapper/photographed_world.h"
#include "tests/testing/status_testing.h"

namespace pepeseg {
namespace {

int NumRegistered(const GlobalModel& model) {
  return static_cast<int>(std::count_if(model.poses.begin(), model.poses.end(),
                                        [](const CameraPose& pose) { return pose.is_registered; }));
}

std::vector<WorldPoint> Joined(std::vector<WorldPoint> first, const std::vector<WorldPoint>& more) {
  first.insert(first.end(), more.begin(), more.end());
  return first;
}

TEST(DifficultCaptures, OrbitClosesItsLoop) {
  std::vector<CameraPose> poses;
  for (int i = 0; i < 24; ++i) {
    const double angle = 2 * std::numbers::pi * i / 24;
    poses.push_back(LookAt({4 * std::sin(angle), 0.2 * (i % 3), -4 * std::cos(angle)}, {0, 0, 0}));
  }
  // Only the points on the camera's side are near enough.
  const World world = PhotographWorld(poses, RandomPoints(500, {0, 0, 0}, {1.5, 1, 1.5}), 600, 0,
                                      /*max_distance=*/4);
  const MapperResult result = Map(world);
  EXPECT_EQ(result.gate, MapperGate::kPassed) << GateName(result.gate);
  EXPECT_EQ(NumRegistered(result.model), 24);
  EXPECT_LT(CentreError(world, result.model), 0.005);
}

// All pairs of a wall have two poses. A few points stand out of it.
TEST(DifficultCaptures, WallIsMappedByThePosesThatCloseTriangles) {
  std::vector<CameraPose> poses;
  for (int i = 0; i < 12; ++i) {
    poses.push_back(LookAt({0.5 * i - 2.75, 0.4 * (i % 3) - 0.4, -3 - 0.3 * (i % 2)},
                           {0.2 * i - 1.1, 0.2 * (i % 2), 0}));
  }
  World world = PhotographWorld(poses, Joined(RandomPoints(400, {0, 0, 0}, {3, 1.5, 0.002}),
                                              RandomPoints(40, {0, 0, -0.3}, {3, 1.5, 0.3}, 1000)));
  for (MapperPhotograph& photograph : world.photographs) photograph.focal = 600;
  const auto flat =
      std::count_if(world.pairs.begin(), world.pairs.end(), [](const VerifiedPair& pair) {
        return pair.geometry.kind == TwoViewKind::kPlanarOrPanoramic;
      });
  ASSERT_GT(flat, static_cast<std::ptrdiff_t>(world.pairs.size() / 2));
  const MapperResult result = Map(world);
  EXPECT_EQ(result.gate, MapperGate::kPassed) << GateName(result.gate);
  EXPECT_LT(CentreError(world, result.model), 0.01);
}

// A wall of 16 by 3 with the same texture at both ends: photographs of one end match those of the
// other.
World WallWithRepeatedTexture(int num_repeated) {
  std::vector<WorldPoint> points = RandomPoints(700, {0, 0, -0.4}, {8, 1.5, 0.4});
  std::vector<WorldPoint> texture = RandomPoints(num_repeated, {-5, 0, 0}, {2, 1.5, 0.01}, 1000);
  points = Joined(points, texture);
  for (WorldPoint& point : texture) point.position.x() += 10;
  points = Joined(points, texture);
  std::vector<CameraPose> poses;
  for (int i = 0; i < 20; ++i) {
    const double x = 0.7 * i - 6.65;
    poses.push_back(LookAt({x, 0.3 * (i % 3), -4}, {x, 0.2 * (i % 2), 0}));
  }
  World world = PhotographWorld(poses, points);
  for (MapperPhotograph& photograph : world.photographs) photograph.focal = 600;
  const auto num_false =
      std::count_if(world.pairs.begin(), world.pairs.end(),
                    [](const VerifiedPair& pair) { return pair.second - pair.first > 10; });
  EXPECT_GT(num_false, 10);
  return world;
}

TEST(DifficultCaptures, RepeatedTextureThatMatchesLessThanNeighboursDoIsNoHarm) {
  const World world = WallWithRepeatedTexture(28);
  const MapperResult result = Map(world);
  EXPECT_EQ(result.gate, MapperGate::kPassed) << GateName(result.gate);
  EXPECT_LT(CentreError(world, result.model), 0.01);
}

TEST(DifficultCaptures, FoldedWallIsRefused) {
  const World world = WallWithRepeatedTexture(120);
  const MapperResult result = Map(world);
  EXPECT_GT(CentreError(world, result.model), 0.5);
  EXPECT_EQ(result.gate, MapperGate::kFolded) << GateName(result.gate);
}

TEST(DifficultCaptures, TwoRoomsAreRefused) {
  std::vector<CameraPose> poses = Arc(10);
  for (const CameraPose& pose : Arc(8)) {
    poses.push_back(pose);
    poses.back().translation = -pose.rotation * (pose.Centre() + Eigen::Vector3d(50, 0, 0));
  }
  const World world = PhotographWorld(poses,
                                      Joined(RandomPoints(250, {0, 0, 0}, {1, 1, 1}),
                                             RandomPoints(250, {50, 0, 0}, {1, 1, 1}, 1000)),
                                      600, 0, /*max_distance=*/10);
  const MapperResult result = Map(world);
  EXPECT_EQ(result.gate, MapperGate::kRegistered) << GateName(result.gate);
  EXPECT_EQ(NumRegistered(result.model), 10);
}

TEST(DifficultCaptures, TurnOnTheSpotIsRefused) {
  std::vector<CameraPose> poses;
  for (int i = 0; i < 10; ++i) poses.push_back(LookAt({0, 0, -4}, {0.1 * i - 0.5, 0.05 * i, 0}));
  EXPECT_EQ(Map(MakeWorld(poses)).gate, MapperGate::kTurn);
}

TEST(DifficultCaptures, TwoPhotographsAreTooFew) {
  EXPECT_EQ(Map(MakeWorld(Arc(2))).gate, MapperGate::kTooFew);
}

// Few pairs say nothing about the focal length at first; the adjustment does.
TEST(DifficultCaptures, FocalLengthComesFromTheAdjustmentIfPairsDoNotGiveIt) {
  World world = MakeWorld(Arc(14), 450);
  std::erase_if(world.pairs, [](const VerifiedPair& pair) { return pair.second > 3; });
  ASSERT_LT(world.pairs.size(), 10u);
  const MapperResult result = Map(world);
  EXPECT_EQ(result.gate, MapperGate::kPassed) << GateName(result.gate);
  EXPECT_NEAR(result.model.lenses[0].focal, 450, 25);
}

// Photographs that see the same points, of which the even ones match no odd one, and the reverse.
TEST(MeasureModel, FindsPhotographsThatShouldMatch) {
  const World world = MakeWorld(Arc(14));
  const MapperResult result = Map(world);
  ASSERT_EQ(result.gate, MapperGate::kPassed);
  std::vector<ViewEdge> edges;
  for (const VerifiedPair& pair : world.pairs) {
    if (pair.first % 2 == pair.second % 2) edges.push_back({pair.first, pair.second, {}, {}});
  }
  const ModelMeasures measures = MeasureModel(world.photographs, result.model, edges, {});
  EXPECT_LT(measures.matched_share, 0.7);
  EXPECT_GT(result.measures.matched_share, 0.95);
}

// Only some pairs of many photographs are compared: the others say nothing about the model.
TEST(MeasureModel, ExpectsNoMatchesOfPairsThatWereNotCompared) {
  World world = MakeWorld(Arc(14));
  std::erase_if(world.pairs, [](const VerifiedPair& pair) { return pair.second - pair.first > 1; });
  EXPECT_EQ(Map(world).gate, MapperGate::kFolded);
  std::vector<PhotographIndices> compared;
  for (const VerifiedPair& pair : world.pairs) compared.emplace_back(pair.second, pair.first);
  MapperOptions options;
  options.compared = compared;
  ASSERT_OK_AND_ASSIGN(const MapperResult result,
                       MapGlobally(world.photographs, world.pairs, options,
                                   [](double) { return absl::OkStatus(); }));
  EXPECT_EQ(result.gate, MapperGate::kPassed) << GateName(result.gate);
  EXPECT_EQ(result.measures.matched_share, 1);
}

TEST(MeasureModel, FindsPairsThatDisagree) {
  const World world = MakeWorld(Arc(10));
  MapperResult result = Map(world);
  ASSERT_EQ(result.gate, MapperGate::kPassed);
  ThreadPool pool(1);
  const std::vector<ViewEdge> edges =
      BuildViewGraph(world.photographs, world.pairs, result.model.lenses, 3, pool);
  const auto agreeing = [&] {
    return MeasureModel(world.photographs, result.model, edges, {}).agreeing_pairs;
  };
  EXPECT_GT(agreeing(), 0.98);
  for (size_t i = 0; i < 5; ++i) {
    result.model.poses[i].rotation =
        RotationFromVector({0, 0.1, 0}) * result.model.poses[i].rotation;
  }
  EXPECT_LT(agreeing(), 0.6);
}

TEST(ChoosePoses, TakesThePoseThatClosesTriangles) {
  const World world = MakeWorld(Arc(5));
  ThreadPool pool(1);
  std::vector<ViewEdge> edges =
      BuildViewGraph(world.photographs, world.pairs, std::vector<GroupLens>{world.lens}, 3, pool);
  ASSERT_EQ(edges.size(), 10u);
  std::vector<Eigen::Matrix3d> right;
  for (ViewEdge& edge : edges) {
    right.push_back(edge.view.pose.rotation);
    ViewPose wrong = edge.view;
    // Another wrong turn for each edge.
    wrong.pose.rotation = RotationFromVector({0.3 + 0.1 * edge.first, 0.2 * edge.second, 0}) *
                          edge.view.pose.rotation;
    edge.others = {edge.view};
    edge.view = wrong;
  }
  const std::vector<TriangleSupport> supports = ChoosePoses(5, 0.05, edges, pool);
  for (size_t i = 0; i < edges.size(); ++i) {
    EXPECT_EQ(edges[i].view.pose.rotation, right[i]);
    EXPECT_EQ(supports[i].num_triangles, 3);
    EXPECT_GT(supports[i].support, 0);
  }
}

}  // namespace
}  // namespace pepeseg
