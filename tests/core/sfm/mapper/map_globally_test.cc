#include "core/sfm/mapper/map_globally.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "core/sfm/mapper/bundle_adjustment.h"
#include "core/sfm/two_view/relative_pose.h"
#include "tests/core/sfm/mapper/photographed_world.h"

namespace pepeseg {
namespace {

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
    MappedPoint point{world.points[p].position, {}};
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

// Enlarged by 4 to 2560 x 1920 pixels, errors have 4 times as many pixels, of 1 / 2.56.
TEST(MeasureModel, CountsErrorsOfLargePhotographsAsIfTheyWereShrunk) {
  World world = MakeWorld(Arc(10));
  GlobalModel model = Map(world).model;
  std::vector<Track> tracks;
  for (const MappedPoint& point : model.points) tracks.push_back(point.track);
  const ModelMeasures small = MeasureModel(world.photographs, model, {}, tracks);
  for (MapperPhotograph& photograph : world.photographs) {
    photograph.width *= 4;
    photograph.height *= 4;
  }
  for (std::vector<Keypoint>& keypoints : world.keypoints) {
    for (Keypoint& k : keypoints) k.x *= 4, k.y *= 4;
  }
  GroupLens& lens = model.lenses[0];
  lens = {4 * lens.width, 4 * lens.height, 4 * lens.focal, lens.k1};
  const ModelMeasures large = MeasureModel(world.photographs, model, {}, tracks);
  EXPECT_GT(small.median_error, 0.05);
  EXPECT_NEAR(large.median_error, 4 / 2.56 * small.median_error, 1e-4);
  EXPECT_NEAR(large.error_90, 4 / 2.56 * small.error_90, 1e-4);
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
  EXPECT_EQ(spoilt(&ModelMeasures::registered_share, 0.99), MapperGate::kRegistered);
  EXPECT_EQ(spoilt(&ModelMeasures::median_error, 1.1), MapperGate::kReprojection);
  EXPECT_EQ(spoilt(&ModelMeasures::error_90, std::nan("")), MapperGate::kReprojection);
  EXPECT_EQ(spoilt(&ModelMeasures::agreeing_pairs, 0.84), MapperGate::kPairs);
  EXPECT_EQ(spoilt(&ModelMeasures::angle_share, 0.4), MapperGate::kAngles);
  EXPECT_EQ(spoilt(&ModelMeasures::in_front_share, 0.97), MapperGate::kInFront);
  EXPECT_EQ(spoilt(&ModelMeasures::matched_share, 0.6), MapperGate::kFolded);
  ModelMeasures folded = GoodMeasures();
  folded.contradicted_pairs = 1;
  EXPECT_EQ(JudgeMeasures(folded), MapperGate::kFolded);
  EXPECT_EQ(spoilt(&ModelMeasures::least_focal, 0.3), MapperGate::kLens);
  EXPECT_EQ(spoilt(&ModelMeasures::most_focal, 3.1), MapperGate::kLens);
  EXPECT_EQ(spoilt(&ModelMeasures::most_k1, 0.4), MapperGate::kLens);
}

}  // namespace
}  // namespace pepeseg
