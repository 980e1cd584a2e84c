#include "core/sfm/mapper/map_globally.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <numbers>
#include <vector>

#include "core/sfm/mapper/bundle_adjustment.h"
#include "core/sfm/mapper/global_positions.h"
#include "core/sfm/two_view/point_pair.h"
#include "core/sfm/two_view/relative_pose.h"

namespace pepeseg {
namespace {

constexpr int kWidth = 640, kHeight = 480;

// Photographs of random points in [-1, 1]^3 with true poses.
struct World {
  GroupLens lens{kWidth, kHeight, 600, 0.02};
  std::vector<CameraPose> poses;
  std::vector<Eigen::Vector3d> points;
  std::vector<std::vector<Keypoint>> keypoints;
  std::vector<std::vector<int>> feature_of;  // [photograph][point], -1 if not seen
  std::vector<MapperPhotograph> photographs;
  std::vector<VerifiedPair> pairs;
};

CameraPose LookAt(const Eigen::Vector3d& centre, const Eigen::Vector3d& target) {
  const Eigen::Vector3d z = (target - centre).normalized();
  const Eigen::Vector3d x = Eigen::Vector3d(0, 1, 0).cross(z).normalized();
  CameraPose pose;
  pose.rotation << x.transpose(), z.cross(x).transpose(), z.transpose();
  pose.translation = -pose.rotation * centre;
  pose.is_registered = true;
  return pose;
}

// A third of a circle around the points.
std::vector<CameraPose> Arc(int count) {
  std::vector<CameraPose> poses;
  for (int i = 0; i < count; ++i) {
    const double angle = 2 * std::numbers::pi / 3 * i / count;
    poses.push_back(LookAt({4 * std::sin(angle), 0.3 * std::sin(5 * angle), -4 * std::cos(angle)},
                           {0.4 * (i % 3 - 1), 0.3 * (i % 2), 0.2 * (i % 4)}));
  }
  return poses;
}

void Photograph(World& world, SeededDraws& draws) {
  for (const CameraPose& pose : world.poses) {
    std::vector<Keypoint>& keypoints = world.keypoints.emplace_back();
    std::vector<int>& feature_of = world.feature_of.emplace_back();
    for (const Eigen::Vector3d& point : world.points) {
      const Eigen::Vector3d seen = pose.ToCamera(point);
      const Eigen::Vector2d pixel = world.lens.Project(seen);
      const bool inside = seen.z() > 0 && pixel.x() > 0 && pixel.y() > 0 && pixel.x() < kWidth &&
                          pixel.y() < kHeight;
      feature_of.push_back(inside ? static_cast<int>(keypoints.size()) : -1);
      if (!inside) continue;
      // Uniform noise of 0.3 pixels.
      keypoints.push_back({static_cast<float>(pixel.x() + draws.Unit() - 0.5),
                           static_cast<float>(pixel.y() + draws.Unit() - 0.5), 1, 0});
    }
  }
  for (const std::vector<Keypoint>& keypoints : world.keypoints) {
    world.photographs.push_back({"", kWidth, kHeight, 0, 0, keypoints});
  }
}

// Verifies all pairs; a share of them has the features of another arrangement of points.
void Pair(World& world, double false_share, SeededDraws& draws) {
  for (uint32_t a = 0; a < world.poses.size(); ++a) {
    for (uint32_t b = a + 1; b < world.poses.size(); ++b) {
      std::vector<FeatureMatch> matches;
      for (size_t p = 0; p < world.points.size(); ++p) {
        if (world.feature_of[a][p] < 0 || world.feature_of[b][p] < 0) continue;
        matches.push_back({static_cast<uint32_t>(world.feature_of[a][p]),
                           static_cast<uint32_t>(world.feature_of[b][p])});
      }
      std::vector<Keypoint> second = world.keypoints[b];
      if (draws.Unit() < false_share) {
        // Consistent, but with another pose: the photograph turned by a right angle.
        for (Keypoint& k : second) {
          k = {kWidth / 2.0f - (k.y - kHeight / 2.0f), kHeight / 2.0f + (k.x - kWidth / 2.0f), 1,
               0};
        }
      }
      VerifiedPair pair{a, b, {}};
      pair.geometry = EstimateTwoViewGeometry(world.keypoints[a], second, matches,
                                              {{kWidth, kHeight, 0}, {kWidth, kHeight, 0}}, {});
      if (!pair.geometry.inliers.empty()) world.pairs.push_back(std::move(pair));
    }
  }
}

World MakeWorld(std::vector<CameraPose> poses, double focal = 600, double false_share = 0) {
  World world;
  world.lens.focal = focal;
  world.poses = std::move(poses);
  SeededDraws draws(3);
  for (int i = 0; i < 250; ++i) {
    const double x = draws.Unit(), y = draws.Unit(), z = draws.Unit();
    world.points.emplace_back(2 * x - 1, 2 * y - 1, 2 * z - 1);
  }
  Photograph(world, draws);
  Pair(world, false_share, draws);
  return world;
}

MapperResult Map(const World& world, int num_threads = 1) {
  MapperOptions options;
  options.num_threads = num_threads;
  absl::StatusOr<MapperResult> result =
      MapGlobally(world.photographs, world.pairs, options, [](double) { return absl::OkStatus(); });
  EXPECT_TRUE(result.ok()) << result.status();
  return *std::move(result);
}

// Returns how far the centres are from the truth, see PositionDifference, after the rotation of the
// first photograph is undone.
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

TEST(MapGlobally, FindsCamerasOnAnArc) {
  const World world = MakeWorld(Arc(14));
  const MapperResult result = Map(world);
  EXPECT_EQ(result.gate, MapperGate::kPassed) << GateName(result.gate);
  EXPECT_EQ(result.measures.registered_share, 1);
  EXPECT_LT(CentreError(world, result.model), 0.005);
  EXPECT_NEAR(result.model.lenses[0].focal, 600, 6);
  EXPECT_NEAR(result.model.lenses[0].k1, 0.02, 0.02);
  EXPECT_GT(result.model.points.size(), 200u);
}

TEST(MapGlobally, FindsFocalLengthsFarFromTheStart) {
  // 0.5 and 1.8 times the start of 1.2 sides.
  for (const double focal : {384.0, 1382.0}) {
    const World world = MakeWorld(Arc(14), focal);
    const MapperResult result = Map(world);
    EXPECT_EQ(result.gate, MapperGate::kPassed) << focal << " " << GateName(result.gate);
    EXPECT_NEAR(result.model.lenses[0].focal, focal, 0.03 * focal);
  }
}

TEST(MapGlobally, FindsCamerasThatMoveForwardOrOnALine) {
  std::vector<CameraPose> forward, line;
  for (int i = 0; i < 10; ++i) {
    forward.push_back(LookAt({0.02 * i, 0.01 * (i % 3), -5 + 0.3 * i}, {0.3 * (i % 2), 0.1, 0}));
    line.push_back(LookAt({-1.5 + 0.3 * i, 0, -4}, {0.2 * (i % 3), 0, 0}));
  }
  for (const std::vector<CameraPose>& poses : {forward, line}) {
    World world = MakeWorld(poses);
    // Forward motion alone hardly determines a focal length.
    for (MapperPhotograph& photograph : world.photographs) photograph.focal = 600;
    const MapperResult result = Map(world);
    EXPECT_EQ(result.measures.registered_share, 1) << GateName(result.gate);
    EXPECT_LT(CentreError(world, result.model), 0.03) << GateName(result.gate);
  }
}

TEST(MapGlobally, SurvivesFalsePairs) {
  const World world = MakeWorld(Arc(14), 600, 0.3);
  const MapperResult result = Map(world);
  ASSERT_EQ(result.model.poses.size(), world.poses.size());
  EXPECT_LT(CentreError(world, result.model), 0.01) << GateName(result.gate);
}

TEST(MapGlobally, RefusesATurnOnTheSpot) {
  std::vector<CameraPose> poses;
  for (int i = 0; i < 10; ++i) poses.push_back(LookAt({0, 0, -4}, {0.1 * i - 0.5, 0.05 * i, 0}));
  EXPECT_EQ(Map(MakeWorld(poses)).gate, MapperGate::kTurn);
}

TEST(MapGlobally, RefusesPairsThatDoNotDetermineTheFocalLength) {
  World world = MakeWorld(Arc(14));
  world.pairs.resize(5);
  EXPECT_EQ(Map(world).gate, MapperGate::kFocal);
}

TEST(MapGlobally, DoesNotDependOnTheNumberOfThreads) {
  const World world = MakeWorld(Arc(10));
  const MapperResult one = Map(world, 1), three = Map(world, 3);
  ASSERT_EQ(one.model.points.size(), three.model.points.size());
  for (size_t i = 0; i < one.model.points.size(); ++i) {
    EXPECT_EQ(one.model.points[i].position, three.model.points[i].position);
  }
  for (size_t i = 0; i < one.model.poses.size(); ++i) {
    EXPECT_EQ(one.model.poses[i].rotation, three.model.poses[i].rotation);
    EXPECT_EQ(one.model.poses[i].translation, three.model.poses[i].translation);
  }
}

TEST(MapGlobally, RefusesIndicesOutOfRange) {
  World world = MakeWorld(Arc(4));
  world.pairs[0].second = 4;
  EXPECT_FALSE(MapGlobally(world.photographs, world.pairs, {}, [](double) {
                 return absl::OkStatus();
               }).ok());
}

TEST(MapGlobally, ReturnsTheErrorOfItsProgress) {
  const World world = MakeWorld(Arc(10));
  const auto result = MapGlobally(world.photographs, world.pairs, {},
                                  [](double) { return absl::CancelledError("stop"); });
  EXPECT_EQ(result.status(), absl::CancelledError("stop"));
}

TEST(AdjustBundle, TakesBackADisturbance) {
  const World world = MakeWorld(Arc(10));
  GlobalModel model{{world.lens}, world.poses, {}};
  for (size_t p = 0; p < world.points.size(); ++p) {
    MappedPoint point{world.points[p], {}};
    for (uint32_t i = 0; i < world.poses.size(); ++i) {
      if (world.feature_of[i][p] < 0) continue;
      point.track.push_back({i, static_cast<uint32_t>(world.feature_of[i][p])});
    }
    if (point.track.size() >= 2) model.points.push_back(point);
  }
  ThreadPool pool(1);
  BundleOptions options;
  options.max_steps = 0;
  const double least = AdjustBundle(world.photographs, options, pool, model).first_cost;
  model.lenses[0].focal *= 1.03;
  for (size_t i = 0; i < model.poses.size(); ++i) {
    const double sign = i % 2 ? 1 : -1;
    model.poses[i].rotation =
        RotationFromVector({0.01 * sign, 0.005, -0.01 * sign}) * model.poses[i].rotation;
    model.poses[i].translation.x() += 0.02 * sign;
  }
  options.max_steps = 50;
  const BundleSummary summary = AdjustBundle(world.photographs, options, pool, model);
  EXPECT_GT(summary.first_cost, 10 * least);
  EXPECT_LT(summary.last_cost, least);
  EXPECT_NEAR(model.lenses[0].focal, 600, 5);
  EXPECT_LT(CentreError(world, model), 0.005);
}

ModelMeasures GoodMeasures() {
  ModelMeasures m;
  m.registered_share = m.agreeing_pairs = m.angle_share = m.in_front_share = m.matched_share = 1;
  m.median_error = 0.4, m.error_90 = 1.2;
  m.least_focal = m.most_focal = 1.2;
  return m;
}

TEST(JudgeMeasures, NamesTheGateThatFails) {
  EXPECT_EQ(JudgeMeasures(GoodMeasures()), MapperGate::kPassed);
  const auto spoilt = [](double ModelMeasures::*measure, double value) {
    ModelMeasures m = GoodMeasures();
    m.*measure = value;
    return JudgeMeasures(m);
  };
  EXPECT_EQ(spoilt(&ModelMeasures::registered_share, 0.94), MapperGate::kRegistered);
  EXPECT_EQ(spoilt(&ModelMeasures::median_error, 1.1), MapperGate::kReprojection);
  EXPECT_EQ(spoilt(&ModelMeasures::error_90, std::nan("")), MapperGate::kReprojection);
  EXPECT_EQ(spoilt(&ModelMeasures::agreeing_pairs, 0.89), MapperGate::kPairs);
  EXPECT_EQ(spoilt(&ModelMeasures::angle_share, 0.4), MapperGate::kAngles);
  EXPECT_EQ(spoilt(&ModelMeasures::in_front_share, 0.97), MapperGate::kInFront);
  EXPECT_EQ(spoilt(&ModelMeasures::matched_share, 0.6), MapperGate::kFolded);
  EXPECT_EQ(spoilt(&ModelMeasures::least_focal, 0.3), MapperGate::kLens);
  EXPECT_EQ(spoilt(&ModelMeasures::most_focal, 3.1), MapperGate::kLens);
  EXPECT_EQ(spoilt(&ModelMeasures::most_k1, 0.4), MapperGate::kLens);
}

}  // namespace
}  // namespace pepeseg
