#include "core/mesh/make_mesh.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "kernels/cpu/cpu_backend.h"
#include "tests/core/mesh/mesh_checks.h"

namespace pepeseg {
namespace {

constexpr double kBallRadius = 0.5;
constexpr float kGaussianSize = 0.03f;
constexpr float kSh0 = 0.28209479f;

// A red ball on a grey floor (y is down), of flat Gaussians, seen from a ring of views above it.
struct BallOnFloor {
  Model model;
  GaussianSet ball;
};

BallOnFloor MakeBallOnFloor() {
  BallOnFloor scene;
  std::vector<Eigen::Vector3d> places, normals;
  constexpr int kNumOnBall = 4000;
  for (int i = 0; i < kNumOnBall; ++i) {  // a spiral, which covers it evenly
    const double y = 1 - (2 * i + 1.0) / kNumOnBall,
                 angle = i * std::numbers::pi * (3 - std::sqrt(5));
    const double r = std::sqrt(1 - y * y);
    normals.emplace_back(r * std::cos(angle), y, r * std::sin(angle));
    places.push_back(kBallRadius * normals.back());
  }
  for (int i = 0; i < 64; ++i) {
    for (int j = 0; j < 64; ++j) {
      places.emplace_back(-1.2 + 2.4 * i / 63, kBallRadius, -1.2 + 2.4 * j / 63);
      normals.emplace_back(0, -1, 0);
    }
  }
  const auto count = static_cast<int64_t>(places.size());
  Gaussians& gaussians = scene.model.gaussians = Gaussians::Zero(count, 0);
  scene.ball.member.assign(places.size(), 0);
  for (size_t i = 0; i < places.size(); ++i) {
    const bool on_ball = i < kNumOnBall;
    scene.ball.member[i] = on_ball ? 1 : 0;
    const auto rotation =
        Eigen::Quaterniond::FromTwoVectors(Eigen::Vector3d(0, 0, 1), normals[i]).cast<float>();
    const float values[] = {rotation.w(), rotation.x(), rotation.y(), rotation.z()};
    for (int k = 0; k < 4; ++k) gaussians.Plane(kRotationPlane + k)[i] = values[k];
    for (int k = 0; k < 3; ++k) {
      gaussians.Plane(kMeanPlane + k)[i] = static_cast<float>(places[i][k]);
      gaussians.Plane(kLogScalePlane + k)[i] = std::log(k == 2 ? 0.002f : kGaussianSize);
      const float color = on_ball ? (k == 0 ? 0.8f : 0.1f) : 0.5f;
      gaussians.Plane(kShPlane + k)[i] = (color - 0.5f) / kSh0;
    }
    gaussians.Plane(kOpacityPlane)[i] = 4;
  }
  for (int i = 0; i < 12; ++i) {
    const double angle = 2 * std::numbers::pi * i / 12;
    ModelView view;
    view.camera = {.width = 128, .height = 128, .fx = 140, .fy = 140, .cx = 64, .cy = 64};
    view.cam_from_world =
        LookAt({2 * std::cos(angle), i % 2 == 0 ? -1.2 : -0.4, 2 * std::sin(angle)}, {0, 0, 0});
    scene.model.views.push_back(view);
  }
  scene.model.scene_radius = 3;
  return scene;
}

class MakeMeshTest : public ::testing::Test {
 protected:
  void SetUp() override {
    BallOnFloor scene = MakeBallOnFloor();
    ball = scene.ball;
    auto made = Segmenter::Create(backend, std::move(scene.model));
    ASSERT_TRUE(made.ok()) << made.status();
    segmenter = *std::move(made);
  }
  absl::StatusOr<TriangleMesh> Make(const GaussianSet* subset, int voxels,
                                    const MeshOptions& options = {}) {
    const auto grid = GridOfMesh(segmenter->model(), subset, voxels);
    if (!grid.ok()) return grid.status();
    return MakeMesh(*segmenter, subset, *grid, options, pool, [] { return absl::OkStatus(); });
  }

  CpuBackend backend{2};
  ThreadPool pool{2};
  GaussianSet ball;
  std::unique_ptr<Segmenter> segmenter;
};

TEST_F(MakeMeshTest, MakesAWatertightMeshOfASelection) {
  const auto mesh = Make(&ball, 48, {.watertight = true});
  ASSERT_TRUE(mesh.ok()) << mesh.status();
  const testing::MeshShape shape = testing::ShapeOf(*mesh);
  EXPECT_TRUE(shape.is_closed);
  EXPECT_EQ(shape.euler, 2);
  // The bottom, which no view sees, is that of the silhouettes: more than the ball, never less.
  const double share = shape.volume / (4 * std::numbers::pi / 3 * std::pow(kBallRadius, 3));
  EXPECT_GT(share, 1);
  EXPECT_LT(share, 1.15);
  const auto grid = GridOfMesh(segmenter->model(), &ball, 48);
  ASSERT_TRUE(grid.ok());
  for (int64_t i = 0; i < mesh->num_vertices(); ++i) {
    EXPECT_GT(mesh->colors[i][0], 3 * mesh->colors[i][1]);
    // The views from above see it down to a little below its middle.
    if (mesh->positions[i].y() > 0.1) continue;
    EXPECT_NEAR(mesh->positions[i].norm(), kBallRadius, grid->voxel);
  }
}

TEST_F(MakeMeshTest, MakesAMeshOfTheScene) {
  const auto mesh = Make(nullptr, 96);
  ASSERT_TRUE(mesh.ok()) << mesh.status();
  EXPECT_FALSE(testing::ShapeOf(*mesh).is_closed);
  const auto grid = GridOfMesh(segmenter->model(), nullptr, 96);
  ASSERT_TRUE(grid.ok());
  int64_t num_on_ball = 0, num_on_floor = 0;
  for (const Eigen::Vector3f& at : mesh->positions) {
    const double to_ball = std::abs(at.norm() - kBallRadius),
                 to_floor = std::abs(at.y() - kBallRadius);
    // Where both meet, the pixels show a blend of their depths.
    if (at.y() > 0.3 && std::hypot(at.x(), at.z()) < 0.8) continue;
    // At the floor's border, the Gaussians fade.
    if (std::max(std::abs(at.x()), std::abs(at.z())) > 1.15) continue;
    EXPECT_LT(std::min(to_ball, to_floor), 1.5 * grid->voxel) << at.transpose();
    ++(to_ball < to_floor ? num_on_ball : num_on_floor);
  }
  EXPECT_GT(num_on_ball, 500);
  EXPECT_GT(num_on_floor, 2000);
}

TEST_F(MakeMeshTest, DoesNotDependOnThreads) {
  const auto two = Make(&ball, 40, {.watertight = true});
  ThreadPool one(1);
  const auto grid = GridOfMesh(segmenter->model(), &ball, 40);
  ASSERT_TRUE(two.ok() && grid.ok());
  const auto other = MakeMesh(*segmenter, &ball, *grid, {.watertight = true}, one,
                              [] { return absl::OkStatus(); });
  ASSERT_TRUE(other.ok());
  EXPECT_EQ(two->positions, other->positions);
  EXPECT_EQ(two->colors, other->colors);
  EXPECT_EQ(two->triangles, other->triangles);
}

TEST_F(MakeMeshTest, RefusesWhatItCannotMesh) {
  GaussianSet none;
  none.member.assign(ball.member.size(), 0);
  EXPECT_EQ(Make(&none, kDefaultMeshVoxels).status().code(), absl::StatusCode::kInvalidArgument);
  none.member.resize(3);
  EXPECT_EQ(Make(&none, kDefaultMeshVoxels).status().code(), absl::StatusCode::kInvalidArgument);
  EXPECT_EQ(Make(&ball, 8).status().code(), absl::StatusCode::kInvalidArgument);
}

TEST_F(MakeMeshTest, EndsWhenItIsNotWanted) {
  int calls = 0;
  const auto grid = GridOfMesh(segmenter->model(), &ball, 32);
  ASSERT_TRUE(grid.ok());
  const auto stopped = MakeMesh(*segmenter, &ball, *grid, {}, pool, [&calls] {
    return ++calls < 3 ? absl::OkStatus() : absl::CancelledError("enough");
  });
  EXPECT_EQ(stopped.status().code(), absl::StatusCode::kCancelled);
  EXPECT_EQ(calls, 3);
}

}  // namespace
}  // namespace pepeseg
