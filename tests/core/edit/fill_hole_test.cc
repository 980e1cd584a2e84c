#include "core/edit/fill_hole.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <set>
#include <span>
#include <string>

#include "core/mesh/make_mesh.h"
#include "core/query/segmenter.h"
#include "kernels/cpu/cpu_backend.h"
#include "kernels/gaussian_planes.h"
#include "tests/core/mesh/ball_on_floor.h"

namespace pepeseg {
namespace {

constexpr double kHoleRadius = 0.2;  // of the floor that no view sees, under the ball

// The ball on its floor as a training leaves it: under the ball there is no floor, but a green blob
// that no view has ever seen.
struct Scene {
  Model model;
  GaussianSet ball;
};
Scene MakeScene() {
  BallOnFloor made = MakeBallOnFloor();
  std::vector<int64_t> rows;
  Scene scene;
  bool has_blob = false;
  for (int64_t i = 0; i < made.model.gaussians.count; ++i) {
    const Eigen::Vector3d at = MeanOf(made.model.gaussians, i);
    const bool on_floor = made.ball.member[i] == 0;
    if (on_floor && std::hypot(at.x(), at.z()) < kHoleRadius && has_blob) continue;
    if (on_floor && std::hypot(at.x(), at.z()) < kHoleRadius) {
      has_blob = true;
      for (int k = 0; k < 3; ++k) {
        made.model.gaussians.Plane(kMeanPlane + k)[i] = k == 1 ? 0.52f : 0.0f;
        made.model.gaussians.Plane(kLogScalePlane + k)[i] = std::log(0.05f);
        made.model.gaussians.Plane(kShPlane + k)[i] = k == 1 ? 1.7f : -1.7f;
      }
    }
    rows.push_back(i);
    scene.ball.member.push_back(made.ball.member[i]);
  }
  EXPECT_TRUE(has_blob);
  scene.model = made.model;
  scene.model.gaussians = made.model.gaussians.Select(rows);
  return scene;
}

struct FillHoleTest : ::testing::Test {
  void SetUp() override {
    Scene scene = MakeScene();
    ball = scene.ball;
    model = scene.model;
  }
  EditedModel Fill(int num_threads = 2) {
    CpuBackend backend{num_threads};
    auto segmenter = Segmenter::Create(backend, model);
    EXPECT_TRUE(segmenter.ok()) << segmenter.status();
    auto fill = HoleFill::Create(**segmenter, ball);
    EXPECT_TRUE(fill.ok()) << fill.status();
    activities.clear();
    while (!(*fill)->done()) {
      const absl::Status status = (*fill)->Next();
      EXPECT_TRUE(status.ok()) << status;
      const HoleFill::Progress progress = (*fill)->progress();
      EXPECT_LE(progress.num_done, progress.num_all);
      activities.insert(progress.activity);
    }
    return (*fill)->Take();
  }
  // Returns the picture of Gaussians from above, 64 x 64 pixels, 0.8 wide on the floor.
  static Image FromAbove(const Gaussians& gaussians) {
    CpuBackend backend{2};
    Renderer renderer(backend, gaussians, 3);
    ModelView view;
    view.camera = {.width = 64, .height = 64, .fx = 160, .fy = 160, .cx = 32, .cy = 32};
    view.cam_from_world = LookAt({0, -1.5, 0}, {0, 0.5, 0});
    return renderer.Color(view);
  }
  // Returns the largest difference of a channel from the floor's grey.
  static int WorstFromGrey(const Image& image) {
    int worst = 0;
    for (const uint8_t value : image.pixels) worst = std::max(worst, std::abs(value - 127));
    return worst;
  }

  // Returns the mean of these differences.
  static double MeanFromGrey(const Image& image) {
    double sum = 0;
    for (const uint8_t value : image.pixels) sum += std::abs(value - 127);
    return sum / static_cast<double>(image.pixels.size());
  }

  Model model;
  GaussianSet ball;
  std::set<std::string> activities;
};

TEST_F(FillHoleTest, ContinuesTheFloorUnderABall) {
  const EditedModel removed =
      RemoveGaussians(model, ball, {Gaussians::Zero(0, model.gaussians.sh_degree), {}});
  EXPECT_GT(WorstFromGrey(FromAbove(removed.gaussians)), 100) << "the hole and the blob";
  const EditedModel filled = Fill();
  EXPECT_EQ(filled.num_removed, ball.count() + 1) << "the ball and the blob";
  EXPECT_GT(filled.num_added, 20);
  EXPECT_EQ(filled.touched.count(), filled.num_added);
  EXPECT_EQ(filled.gaussians.count, model.gaussians.count - filled.num_removed + filled.num_added);
  EXPECT_LT(WorstFromGrey(FromAbove(filled.gaussians)), 24);
  for (int64_t i = 0; i < filled.gaussians.count; ++i) {
    if (filled.touched.member[i] == 0) continue;
    const Eigen::Vector3d at = MeanOf(filled.gaussians, i);
    EXPECT_NEAR(at.y(), kBallRadius, 0.03);
    EXPECT_LT(std::hypot(at.x(), at.z()), kHoleRadius + 0.1);
  }
  EXPECT_TRUE(activities.contains("looking behind the thing"));
}

TEST_F(FillHoleTest, LightsTheShadow) {
  const auto in_shadow = [](const Eigen::Vector3d& at) {
    return at.x() > 0 && at.x() < 0.8 && std::abs(at.z()) < 0.3;
  };
  for (int64_t i = 0; i < model.gaussians.count; ++i) {
    if (ball.member[i] != 0 || !in_shadow(MeanOf(model.gaussians, i))) continue;
    for (int k = 0; k < 3; ++k) {
      float& value = model.gaussians.Plane(kShPlane + k)[i];
      if (value < 1) value = (0.3f - 0.5f) / 0.28209479f;  // not the blob
    }
  }
  const EditedModel filled = Fill();
  EXPECT_GT(filled.num_changed, 100);
  const EditedModel removed =
      RemoveGaussians(model, ball, {Gaussians::Zero(0, model.gaussians.sh_degree), {}});
  const double before = MeanFromGrey(FromAbove(removed.gaussians));
  EXPECT_GT(before, 15);
  // At the edge of the shadow some Gaussians are in between.
  EXPECT_LT(MeanFromGrey(FromAbove(filled.gaussians)), 0.35 * before);
}

TEST_F(FillHoleTest, GivesTheSameOnAnyNumberOfThreads) {
  const EditedModel one = Fill(1), three = Fill(3);
  EXPECT_EQ(one.gaussians.planes, three.gaussians.planes);
}

TEST_F(FillHoleTest, RemovesOnlyTheThingWithoutViews) {
  model.views.clear();
  const EditedModel edited = Fill();
  EXPECT_EQ(edited.num_removed, ball.count());
}

// Its pixels exceed an int: such a patch is in front of everything.
TEST(OpenPixels, AreCoveredByAPatchInFrontOfTheCamera) {
  ModelView view;
  view.camera = {.width = 8, .height = 6, .fx = 10, .fy = 10, .cx = 4, .cy = 3};
  ThingLook look;
  look.changed.assign(48, 1);
  look.depth.assign(48, 0);
  Patch patch{{0, 0, 1e-12}, Eigen::Vector3d::UnitZ(), 0.1, Eigen::Vector3d::Zero()};
  EXPECT_EQ(std::ranges::count(OpenPixels(view, look, std::span(&patch, 1)), 1), 0);
  patch.mean = {3, 0, 1e-12};
  EXPECT_EQ(std::ranges::count(OpenPixels(view, look, std::span(&patch, 1)), 1), 48);
  patch = {{-0.35, 0, 1}, Eigen::Vector3d::UnitZ(), 0.01, Eigen::Vector3d::Zero()};
  EXPECT_EQ(std::ranges::count(OpenPixels(view, look, std::span(&patch, 1)), 1), 48 - 6);
}

// The thing is one point of the plane, in the middle of a gap in it.
TEST_F(FillHoleTest, FillsUnderAThingThatIsThinSeenFromAbove) {
  std::vector<int64_t> thing;
  for (int64_t i = 0; i < model.gaussians.count; ++i) {
    if (ball.member[i] != 0 && thing.size() < 2) thing.push_back(i);
  }
  for (const int64_t row : thing) {
    for (int k = 0; k < 3; ++k) model.gaussians.Plane(kMeanPlane + k)[row] = 0;
  }
  model.gaussians.Plane(kMeanPlane + 1)[thing[1]] = 0.2f;
  CpuBackend backend{2};
  const auto segmenter = Segmenter::Create(backend, model);
  ASSERT_TRUE(segmenter.ok());
  GaussianSet rest{std::vector<uint8_t>(ball.member.size(), 1)};
  for (size_t i = 0; i < rest.member.size(); ++i) rest.member[i] = ball.member[i] != 0 ? 0 : 1;
  SupportPlane plane;
  plane.point = {0, kBallRadius, 0};
  plane.normal = {0, -1, 0};
  plane.tolerance = 11 * kHoleRadius;  // the picture's margin, two of its pixels, covers the gap
  plane.spacing = 0.1;
  const auto fill = FillPlane(**segmenter, plane, rest, thing);
  ASSERT_TRUE(fill.ok()) << fill.status();
  EXPECT_GT(fill->patches.size(), 0);
  for (const Patch& patch : fill->patches) {
    EXPECT_LT((patch.mean - plane.point).norm(), 2 * kHoleRadius);
  }
}

// Only the blob under the ball would stay, which no view has seen.
TEST_F(FillHoleTest, RefusesWhatHidesAllElse) {
  const Gaussians& gaussians = model.gaussians;
  for (int64_t i = 0; i < gaussians.count; ++i) {
    const bool is_blob = ball.member[i] == 0 && gaussians.Plane(kMeanPlane + 1)[i] == 0.52f;
    ball.member[i] = is_blob ? 0 : 1;
  }
  ASSERT_EQ(ball.count(), gaussians.count - 1);
  CpuBackend backend{2};
  const auto segmenter = Segmenter::Create(backend, model);
  ASSERT_TRUE(segmenter.ok());
  const auto fill = HoleFill::Create(**segmenter, ball);
  ASSERT_TRUE(fill.ok());
  absl::Status status;
  while (status.ok() && !(*fill)->done()) status = (*fill)->Next();
  EXPECT_EQ(status.code(), absl::StatusCode::kInvalidArgument) << status;
}

TEST_F(FillHoleTest, RefusesNothingAndAll) {
  CpuBackend backend{1};
  const auto segmenter = Segmenter::Create(backend, model);
  ASSERT_TRUE(segmenter.ok());
  for (const uint8_t member : {0, 1}) {
    const GaussianSet set{std::vector<uint8_t>(ball.member.size(), member)};
    EXPECT_EQ(HoleFill::Create(**segmenter, set).status().code(),
              absl::StatusCode::kInvalidArgument);
  }
}

}  // namespace
}  // namespace pepeseg
