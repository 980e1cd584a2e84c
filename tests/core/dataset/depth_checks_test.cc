#include "core/dataset/depth_checks.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <random>

#include "core/dataset/import.h"
#include "tests/testing/status_testing.h"

namespace pepeseg {
namespace {

using ::testing::Contains;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::Not;

// Views whose depth priors are made of the points' true depth, and points at random depths.
struct DepthScene {
  explicit DepthScene(int num_points = 300) {
    std::mt19937 random(3);
    std::uniform_real_distribution<float> in(-1, 1);
    for (int i = 0; i < num_points; ++i) {
      points.push_back({{in(random), in(random), 4 + in(random)}, {}});
    }
    for (int i = 0; i < 2; ++i) {
      View view;
      view.name = i == 0 ? "a.jpg" : "b.jpg";
      view.camera = {.width = 400, .height = 400, .fx = 400, .fy = 400, .cx = 200, .cy = 200};
      view.depth.kind = DepthPrior::Kind::kDepth;
      view.depth.values.assign(400 * 400, 0.5F);
      views.push_back(view);
    }
  }

  // Draws values of each point into the maps; `value` of its depth.
  template <class Value>
  void Draw(const Value& value) {
    for (View& view : views) {
      for (const ScenePoint& point : points) {
        const Eigen::Vector3f& at = point.position;
        const auto x = static_cast<int>(400 * at.x() / at.z() + 200);
        const auto y = static_cast<int>(400 * at.y() / at.z() + 200);
        view.depth.values[static_cast<size_t>(y) * 400 + x] = value(at.z());
      }
    }
  }
  std::vector<std::string> Correct() {
    std::vector<View*> all;
    for (View& view : views) all.push_back(&view);
    return CorrectDepthKinds(all, points);
  }

  std::vector<ScenePoint> points;
  std::vector<View> views;
};

TEST(CorrectDepthKinds, ReadsDisparityInDepthAsDisparity) {
  DepthScene scene;
  scene.Draw([](float z) { return 1 / z; });
  EXPECT_THAT(scene.Correct(), ElementsAre(HasSubstr("2 maps of depth/: their rank correlation")));
  for (const View& view : scene.views) EXPECT_EQ(view.depth.kind, DepthPrior::Kind::kDisparity);
}

TEST(CorrectDepthKinds, ReadsDepthInDisparityAsDepth) {
  DepthScene scene;
  for (View& view : scene.views) view.depth.kind = DepthPrior::Kind::kDisparity;
  scene.Draw([](float z) { return z; });
  EXPECT_THAT(scene.Correct(), ElementsAre(HasSubstr("they hold depth (far is large)")));
  for (const View& view : scene.views) EXPECT_EQ(view.depth.kind, DepthPrior::Kind::kDepth);
}

TEST(CorrectDepthKinds, SaysNothingOfMapsThatAgree) {
  DepthScene scene;
  scene.Draw([](float z) { return z; });
  EXPECT_THAT(scene.Correct(), ::testing::IsEmpty());
}

TEST(CorrectDepthKinds, WarnsOfMapsThatHardlyAgree) {
  DepthScene scene;
  std::mt19937 random(5);
  scene.Draw([&](float) { return static_cast<float>(random() % 1000); });
  EXPECT_THAT(scene.Correct(), ElementsAre(HasSubstr("they hardly agree")));
  EXPECT_EQ(scene.views[0].depth.kind, DepthPrior::Kind::kDepth);
}

TEST(CorrectDepthKinds, WarnsIfNoPointsCanConfirm) {
  DepthScene scene(10);
  EXPECT_THAT(scene.Correct(), ElementsAre(HasSubstr("too few points to check it")));
}

TEST(CorrectDepthKinds, LeavesPriorsOfThePointsAlone) {
  DepthScene scene;
  for (View& view : scene.views) view.depth.from_points = true;
  scene.Draw([](float z) { return 1 / z; });
  EXPECT_THAT(scene.Correct(), ::testing::IsEmpty());
}

// The same files of a depth sensor, once in depth/ and once in disparity/.
TEST(ImportCapture, ReadsDepthOfASensorAlikeInBothFolders) {
  ASSERT_OK_AND_ASSIGN(std::vector<DatasetFile> files, ListDataset(PEPESEG_TEST_DATA "/apc_shelf"));
  ASSERT_OK_AND_ASSIGN(const Capture depth, ImportCapture(files, {.image_scale = 0.25}));
  EXPECT_THAT(depth.warnings, Not(Contains(HasSubstr("depth/"))));
  for (DatasetFile& file : files) {
    if (file.kind == FileKind::kDepth) file.kind = FileKind::kDisparity;
  }
  ASSERT_OK_AND_ASSIGN(const Capture disparity, ImportCapture(files, {.image_scale = 0.25}));
  EXPECT_THAT(disparity.warnings, Contains(HasSubstr("they hold depth")));
  for (const View& view : disparity.views) {
    if (view.depth.values.empty()) continue;
    EXPECT_EQ(view.depth.kind, DepthPrior::Kind::kDepth);
  }
}

}  // namespace
}  // namespace pepeseg
