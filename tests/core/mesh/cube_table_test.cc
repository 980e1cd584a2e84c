#include "core/mesh/cube_table.h"

#include <gtest/gtest.h>

#include <random>

#include "core/mesh/distance_volume.h"
#include "tests/core/mesh/mesh_checks.h"

namespace pepeseg {
namespace {

TEST(CubeTable, HasTheEdgesBetweenInsideAndOutside) {
  for (unsigned inside = 0; inside < 256; ++inside) {
    std::array<bool, 12> is_used{};
    for (const std::array<uint8_t, 3>& triangle : CubeTable()[inside]) {
      for (const uint8_t edge : triangle) is_used[edge] = true;
    }
    for (int edge = 0; edge < 12; ++edge) {
      const auto [axis, from] = kCubeEdges[edge];
      const bool is_cut = (inside >> from & 1) != (inside >> (from | 1 << axis) & 1);
      EXPECT_EQ(is_used[edge], is_cut) << inside << " " << edge;
    }
  }
}

// All ways in which cubes with random corners meet.
TEST(CubeTable, MakesClosedManifoldsOfRandomCorners) {
  constexpr int kSide = 24;
  std::mt19937 random(3);
  std::vector<uint8_t> inside(kSide * kSide * kSide);
  const auto at = [](int x, int y, int z) { return (z * kSide + y) * kSide + x; };
  for (int z = 1; z + 1 < kSide; ++z) {
    for (int y = 1; y + 1 < kSide; ++y) {
      for (int x = 1; x + 1 < kSide; ++x) inside[at(x, y, z)] = random() & 1;
    }
  }
  TriangleMesh mesh;
  std::map<std::pair<int, int>, uint32_t> vertices;  // by voxel and axis
  for (int z = 0; z + 1 < kSide; ++z) {
    for (int y = 0; y + 1 < kSide; ++y) {
      for (int x = 0; x + 1 < kSide; ++x) {
        unsigned corners = 0;
        for (int c = 0; c < 8; ++c) {
          corners |= unsigned{inside[at(x + (c & 1), y + (c >> 1 & 1), z + (c >> 2))]} << c;
        }
        for (const std::array<uint8_t, 3>& edges : CubeTable()[corners]) {
          std::array<uint32_t, 3> triangle{};
          for (int i = 0; i < 3; ++i) {
            const auto [axis, from] = kCubeEdges[edges[i]];
            Eigen::Vector3f place(x + (from & 1), y + (from >> 1 & 1), z + (from >> 2));
            const int voxel = at(x + (from & 1), y + (from >> 1 & 1), z + (from >> 2));
            const auto [found, is_new] =
                vertices.try_emplace({voxel, axis}, static_cast<uint32_t>(vertices.size()));
            place[axis] += 0.5f;
            if (is_new) mesh.positions.push_back(place);
            triangle[i] = found->second;
          }
          mesh.triangles.push_back(triangle);
        }
      }
    }
  }
  const testing::MeshShape shape = testing::ShapeOf(mesh);
  EXPECT_TRUE(shape.is_closed);
  EXPECT_GT(shape.volume, 0);
}

}  // namespace
}  // namespace pepeseg
