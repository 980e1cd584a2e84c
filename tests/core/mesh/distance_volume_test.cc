#include "core/mesh/distance_volume.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <vector>

#include "core/mesh/make_mesh.h"
#include "core/mesh/surface.h"
#include "tests/core/mesh/mesh_checks.h"
#include "tests/testing/ray_scene.h"
#include "tests/testing/status_testing.h"

namespace pepeseg {
namespace {

using testing::MeshShape;
using testing::ShapeOf;
using testing::Surface;

constexpr int kVoxels = 64;

// Returns views from two rings around the origin, above and below it.
std::vector<View> RingViews() {
  std::vector<View> views;
  for (int i = 0; i < 16; ++i) {
    const double angle = 2 * std::numbers::pi * i / 16, height = i % 2 == 0 ? 1.8 : -1.8;
    View view;
    view.camera = {.width = 160, .height = 160, .fx = 180, .fy = 180, .cx = 80, .cy = 80};
    view.cam_from_world =
        LookAt(3 * Eigen::Vector3d(std::cos(angle), height / 2, std::sin(angle)), {0, 0, 0});
    views.push_back(view);
  }
  return views;
}

std::vector<float> DepthOf(const Surface& surface, const View& view) {
  std::vector<float> depth;
  for (const testing::Hit& hit : testing::TraceCenters({&surface, 1}, view)) {
    depth.push_back(hit.surface == nullptr ? 0 : static_cast<float>(hit.distance));
  }
  return depth;
}

// Returns the box of a surface with a margin.
VoxelGrid GridAround(const Surface& surface, int voxels = kVoxels) {
  const Eigen::Vector3d half =
      surface.is_ball ? Eigen::Vector3d::Constant(surface.half.x()) : surface.half;
  const absl::StatusOr<VoxelGrid> grid =
      GridOf(surface.center - 1.05 * half, surface.center + 1.05 * half, voxels);
  EXPECT_TRUE(grid.ok());
  return *grid;
}

void FuseViews(const Surface& surface, DistanceVolume& volume) {
  for (const View& view : RingViews()) {
    const std::vector<float> depth = DepthOf(surface, view);
    Image color = {view.camera.width, view.camera.height, 3, {}};
    for (size_t i = 0; i < depth.size(); ++i)
      color.pixels.insert(color.pixels.end(), {200, 100, 7});
    volume.Fuse(view, depth, color);
  }
}

pepeseg::Surface MeshOf(const Surface& surface, bool watertight, int num_threads = 2) {
  ThreadPool pool(num_threads);
  DistanceVolume volume(GridAround(surface), pool);
  FuseViews(surface, volume);
  absl::StatusOr<pepeseg::Surface> found = volume.FindSurface(watertight);
  EXPECT_TRUE(found.ok());
  DropIslands(0.01, *found);
  SmoothUnseen(*found);
  FillColors(*found);
  SetNormals(found->mesh);
  return *std::move(found);
}

Surface Ball() {
  return {
      .label = 1, .is_ball = true, .center = {0, 0, 0}, .half = {0.8, 0, 0}, .color = {1, 1, 1}};
}
Surface Box() {
  return {.label = 1,
          .is_ball = false,
          .center = {0, 0, 0},
          .half = {0.8, 0.5, 0.6},
          .color = {1, 1, 1}};
}

TEST(DistanceVolume, FindsABallWithinHalfAVoxel) {
  const pepeseg::Surface found = MeshOf(Ball(), /*watertight=*/true);
  const double voxel = GridAround(Ball()).voxel;
  double most = 0;
  for (int64_t i = 0; i < found.mesh.num_vertices(); ++i) {
    const Eigen::Vector3f& at = found.mesh.positions[i];
    most = std::max(most, std::abs(at.norm() - 0.8));
    EXPECT_NEAR(found.mesh.normals[i].norm(), 1, 1e-5);
    EXPECT_GT(found.mesh.normals[i].dot(at.normalized()), 0.9);
    EXPECT_EQ(found.mesh.colors[i], (std::array<uint8_t, 3>{200, 100, 7}));
  }
  EXPECT_LT(most, voxel / 2);
  const MeshShape shape = ShapeOf(found.mesh);
  EXPECT_TRUE(shape.is_closed);
  EXPECT_EQ(shape.euler, 2);
  const double truth = 4 * std::numbers::pi / 3 * std::pow(0.8, 3);
  EXPECT_NEAR(shape.volume / truth, 1, 0.02);
}

TEST(DistanceVolume, FindsABoxWithinHalfAVoxel) {
  const pepeseg::Surface found = MeshOf(Box(), /*watertight=*/true);
  const double voxel = GridAround(Box()).voxel;
  for (const Eigen::Vector3f& at : found.mesh.positions) {
    const Eigen::Vector3d over = at.cast<double>().cwiseAbs() - Box().half;
    const double distance = over.cwiseMax(0).norm() + std::min(over.maxCoeff(), 0.0);
    // Edges are rounded, by less than a voxel.
    const bool at_edge = (over.array() > -2 * voxel).count() > 1;
    EXPECT_LT(std::abs(distance), at_edge ? voxel : voxel / 2) << at.transpose();
  }
  const MeshShape shape = ShapeOf(found.mesh);
  EXPECT_TRUE(shape.is_closed);
  EXPECT_EQ(shape.euler, 2);
  EXPECT_NEAR(shape.volume / (8 * Box().half.prod()), 1, 0.02);
}

TEST(DistanceVolume, IsTheSameForAnyNumberOfThreads) {
  const pepeseg::Surface one = MeshOf(Ball(), /*watertight=*/true, 1);
  const pepeseg::Surface four = MeshOf(Ball(), /*watertight=*/true, 4);
  EXPECT_EQ(one.mesh.positions, four.mesh.positions);
  EXPECT_EQ(one.mesh.normals, four.mesh.normals);
  EXPECT_EQ(one.mesh.colors, four.mesh.colors);
  EXPECT_EQ(one.mesh.triangles, four.mesh.triangles);
}

// One view sees the front of a ball: an open mesh is of that, and a watertight one has a back.
TEST(DistanceVolume, ClosesWhatNoViewSees) {
  const View front = RingViews()[0];
  const std::vector<float> depth = DepthOf(Ball(), front);
  Image color = {front.camera.width, front.camera.height, 3, {}};
  color.pixels.resize(3 * depth.size());
  ThreadPool pool(2);
  DistanceVolume volume(GridAround(Ball()), pool);
  volume.Fuse(front, depth, color);
  const auto open = volume.FindSurface(/*watertight=*/false);
  ASSERT_TRUE(open.ok());
  EXPECT_GT(open->mesh.num_triangles(), 1000);
  EXPECT_FALSE(ShapeOf(open->mesh).is_closed);
  // What the view does not see reaches to the border of the volume, unless other views carve it.
  const auto filled = volume.FindSurface(/*watertight=*/true);
  ASSERT_TRUE(filled.ok());
  EXPECT_TRUE(ShapeOf(filled->mesh).is_closed);
  for (const View& view : RingViews()) volume.Carve(view, DepthOf(Ball(), view));
  auto carved = volume.FindSurface(/*watertight=*/true);
  ASSERT_TRUE(carved.ok());
  DropIslands(0.1, *carved);
  SmoothUnseen(*carved);
  const MeshShape shape = ShapeOf(carved->mesh);
  EXPECT_TRUE(shape.is_closed);
  EXPECT_LT(shape.volume, 0.75 * ShapeOf(filled->mesh).volume);
  const double truth = 4 * std::numbers::pi / 3 * std::pow(0.8, 3);
  EXPECT_NEAR(shape.volume / truth, 1, 0.2);  // the visual hull
}

TEST(DistanceVolume, LeavesOutPixelsWhereTheDepthJumps) {
  // Two walls, one behind the other, with a blend of both between them.
  View view;
  view.camera = {.width = 64, .height = 64, .fx = 64, .fy = 64, .cx = 32, .cy = 32};
  std::vector<float> depth(64 * 64);
  for (size_t i = 0; i < depth.size(); ++i) {
    const size_t x = i % 64;
    depth[i] = x < 32 ? 2.0f : x == 32 ? 2.5f : 3.0f;
  }
  const Image color = {64, 64, 3, std::vector<uint8_t>(3 * depth.size())};
  ThreadPool pool(2);
  const auto grid = GridOf({-1, -1, 1.5}, {1, 1, 3.5}, kVoxels);
  ASSERT_TRUE(grid.ok());
  DistanceVolume volume(*grid, pool);
  volume.Fuse(view, depth, color);
  const auto found = volume.FindSurface(/*watertight=*/false);
  ASSERT_TRUE(found.ok());
  EXPECT_GT(found->mesh.num_vertices(), 1000);
  for (const Eigen::Vector3f& at : found->mesh.positions) {
    EXPECT_LT(std::min(std::abs(at.z() - 2), std::abs(at.z() - 3)), grid->voxel) << at.transpose();
  }
}

// A wall that two views show, and a third one from the same place shows nothing.
double DepthOfWall(bool empty_is_outside) {
  View view;
  view.camera = {.width = 64, .height = 64, .fx = 64, .fy = 64, .cx = 32, .cy = 32};
  const std::vector<float> depth(64 * 64, 2.0f), nothing(64 * 64);
  const Image color = {64, 64, 3, std::vector<uint8_t>(3 * depth.size())};
  ThreadPool pool(2);
  const auto grid = GridOf({-0.5, -0.5, 1.5}, {0.5, 0.5, 2.5}, 32);
  EXPECT_TRUE(grid.ok());
  DistanceVolume volume(*grid, pool);
  volume.Fuse(view, depth, color);
  volume.Fuse(view, depth, color);
  volume.Fuse(view, nothing, color, empty_is_outside);
  const auto found = volume.FindSurface(/*watertight=*/false);
  EXPECT_TRUE(found.ok());
  double sum = 0;
  for (const Eigen::Vector3f& at : found->mesh.positions) sum += at.z();
  return found->mesh.positions.empty() ? 0 : sum / static_cast<double>(found->mesh.num_vertices());
}

TEST(DistanceVolume, TakesEmptyPixelsForFreeSpaceOnlyOfThingsThatAreAlone) {
  EXPECT_NEAR(DepthOfWall(/*empty_is_outside=*/false), 2, 1e-3);
  const double moved = DepthOfWall(/*empty_is_outside=*/true);
  EXPECT_TRUE(moved == 0 || moved > 2.02) << moved;
}

// Depths of two views that differ by more than four voxels.
TEST(DistanceVolume, JoinsDepthsThatDifferByLessThanItsTruncation) {
  View view;
  view.camera = {.width = 64, .height = 64, .fx = 64, .fy = 64, .cx = 32, .cy = 32};
  const std::vector<float> near(64 * 64, 1.9f), far(64 * 64, 2.1f);
  const Image color = {64, 64, 3, std::vector<uint8_t>(3 * near.size())};
  ThreadPool pool(2);
  const auto grid = GridOf({-0.5, -0.5, 1.5}, {0.5, 0.5, 2.5}, 32);
  ASSERT_TRUE(grid.ok());
  DistanceVolume volume(*grid, pool, 0.4);
  EXPECT_EQ(volume.truncation(), 0.4);
  EXPECT_EQ(DistanceVolume(*grid, pool, 0.01).truncation(), 4 * grid->voxel);
  volume.Fuse(view, near, color);
  volume.Fuse(view, far, color);
  const auto found = volume.FindSurface(/*watertight=*/false);
  ASSERT_TRUE(found.ok());
  EXPECT_GT(found->mesh.num_vertices(), 500);
  for (const Eigen::Vector3f& at : found->mesh.positions) {
    EXPECT_GT(at.z(), 1.95);
    EXPECT_LT(at.z(), 2.1);
  }
}

TEST(VoxelGrid, HasTheVoxelsOnTheLongestSide) {
  const auto grid = GridOf({0, 0, 0}, {2, 1, 0.5}, 100);
  ASSERT_TRUE(grid.ok());
  EXPECT_DOUBLE_EQ(grid->voxel, 0.02);
  EXPECT_EQ(grid->size, (std::array<int, 3>{106, 56, 31}));
}

TEST(VoxelGrid, RefusesWhatDoesNotFit) {
  const auto code = [](double side, int voxels) {
    return GridOf({0, 0, 0}, {side, side, side}, voxels).status().code();
  };
  EXPECT_EQ(code(1, 31), absl::StatusCode::kInvalidArgument);
  EXPECT_EQ(code(1, 1025), absl::StatusCode::kInvalidArgument);
  EXPECT_EQ(code(0, 64), absl::StatusCode::kInvalidArgument);
  EXPECT_EQ(code(1, 505), absl::StatusCode::kOk);
  const auto status = GridOf({0, 0, 0}, {1, 1, 1}, 1024).status();
  EXPECT_EQ(status.message(),
            "1024 voxels on the longest side make a volume of 1030 x 1030 x 1030, more than "
            "134217728 voxels; at most 508 fit");
  EXPECT_TRUE(GridOf({0, 0, 0}, {1, 1, 1}, 506).ok());
  EXPECT_TRUE(GridOf({0, 0, 0}, {1, 1, 0.1}, 1024).ok());
}

TEST(DropIslands, KeepsTheLargeParts) {
  pepeseg::Surface surface;
  // A strip of ten triangles, and one triangle.
  for (int i = 0; i < 15; ++i) {
    surface.mesh.positions.emplace_back(i / 2, i % 2, 0);
    surface.mesh.colors.push_back({static_cast<uint8_t>(i), 0, 0});
  }
  surface.is_seen.assign(15, 1);
  surface.has_color.assign(15, 1);
  surface.mesh.triangles.push_back({0, 1, 2});
  for (uint32_t i = 3; i < 13; ++i) surface.mesh.triangles.push_back({i, i + 1, i + 2});
  pepeseg::Surface all = surface;
  DropIslands(0.5, surface);
  EXPECT_EQ(surface.mesh.num_triangles(), 10);
  EXPECT_EQ(surface.mesh.num_vertices(), 12);
  EXPECT_EQ(surface.mesh.triangles[0], (std::array<uint32_t, 3>{0, 1, 2}));
  EXPECT_EQ(surface.mesh.colors[0][0], 3);
  EXPECT_EQ(surface.is_seen.size(), 12u);
  DropIslands(0, all);
  EXPECT_EQ(all.mesh.num_triangles(), 11);
}

}  // namespace
}  // namespace pepeseg
