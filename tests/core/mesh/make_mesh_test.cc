#include "core/mesh/make_mesh.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "kernels/cpu/cpu_backend.h"
#include "tests/core/mesh/ball_on_floor.h"
#include "tests/core/mesh/mesh_checks.h"

namespace pepeseg {
namespace {

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
