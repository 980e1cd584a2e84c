#include "core/mesh/simplify.h"

#include <gtest/gtest.h>

#include <cmath>
#include <map>
#include <numbers>
#include <utility>

#include "core/mesh/surface.h"
#include "tests/core/mesh/mesh_checks.h"

namespace pepeseg {
namespace {

// A grid of triangles on the unit sphere, closed at the poles, red above the middle.
TriangleMesh Ball(int rings, int sectors) {
  TriangleMesh mesh;
  const auto add = [&mesh](double polar, double around) {
    mesh.positions.emplace_back(std::sin(polar) * std::cos(around), std::cos(polar),
                                std::sin(polar) * std::sin(around));
    mesh.colors.push_back(polar < std::numbers::pi / 2 ? std::array<uint8_t, 3>{255, 0, 0}
                                                       : std::array<uint8_t, 3>{0, 0, 255});
  };
  add(0, 0);
  for (int ring = 1; ring < rings; ++ring) {
    for (int k = 0; k < sectors; ++k) {
      add(std::numbers::pi * ring / rings, 2 * std::numbers::pi * k / sectors);
    }
  }
  add(std::numbers::pi, 0);
  const auto at = [sectors](int ring, int k) {
    return static_cast<uint32_t>(1 + (ring - 1) * sectors + k % sectors);
  };
  const auto last = static_cast<uint32_t>(mesh.positions.size() - 1);
  for (int k = 0; k < sectors; ++k) {
    mesh.triangles.push_back({0, at(1, k + 1), at(1, k)});
    for (int ring = 1; ring + 1 < rings; ++ring) {
      mesh.triangles.push_back({at(ring, k), at(ring, k + 1), at(ring + 1, k)});
      mesh.triangles.push_back({at(ring, k + 1), at(ring + 1, k + 1), at(ring + 1, k)});
    }
    mesh.triangles.push_back({last, at(rings - 1, k), at(rings - 1, k + 1)});
  }
  SetNormals(mesh);
  return mesh;
}

TEST(Simplify, KeepsABallClosedAndRound) {
  TriangleMesh mesh = Ball(100, 100);
  const double volume = testing::ShapeOf(mesh).volume;
  ASSERT_NEAR(volume, 4 * std::numbers::pi / 3, 0.01);
  Simplify(1000, mesh);
  EXPECT_LE(mesh.num_triangles(), 1000);
  EXPECT_GT(mesh.num_triangles(), 900);
  EXPECT_EQ(mesh.num_vertices(), mesh.num_triangles() / 2 + 2) << "a vertex is left over";
  const testing::MeshShape shape = testing::ShapeOf(mesh);
  EXPECT_TRUE(shape.is_closed);
  EXPECT_EQ(shape.euler, 2);
  EXPECT_NEAR(shape.volume / volume, 1, 0.02);
  ASSERT_EQ(mesh.normals.size(), mesh.positions.size());
  ASSERT_EQ(mesh.colors.size(), mesh.positions.size());
  for (int64_t i = 0; i < mesh.num_vertices(); ++i) {
    EXPECT_NEAR(mesh.positions[i].norm(), 1, 1e-5);
    EXPECT_GT(mesh.normals[i].dot(mesh.positions[i]), 0.95);
    EXPECT_EQ(mesh.colors[i][0], mesh.positions[i].y() > 1e-3 ? 255 : 0);
  }
}

// Two balls of one mesh that share an edge: four triangles meet in it.
TEST(Simplify, GivesSheetsThatTouchTheirOwnVertices) {
  TriangleMesh mesh = Ball(20, 20), other = Ball(20, 20);
  const auto first = static_cast<uint32_t>(mesh.positions.size());
  for (const Eigen::Vector3f& at : other.positions) mesh.positions.push_back(at.array() + 3);
  mesh.colors.insert(mesh.colors.end(), other.colors.begin(), other.colors.end());
  for (auto triangle : other.triangles) {
    for (uint32_t& vertex : triangle) {
      vertex += first;
      // The pole of one ball, and a vertex next to it, are those of the other.
      if (vertex == first || vertex == first + 1) vertex -= first;
    }
    mesh.triangles.push_back(triangle);
  }
  ASSERT_FALSE(testing::ShapeOf(mesh).is_closed);
  const int64_t before = mesh.num_triangles();
  Simplify(before - 2, mesh);
  EXPECT_LE(mesh.num_triangles(), before - 2);
  const testing::MeshShape shape = testing::ShapeOf(mesh);
  EXPECT_TRUE(shape.is_closed);
  EXPECT_EQ(shape.euler, 4);
}

// Merged this far, thin rings have two edges between the same two vertices.
TEST(Simplify, KeepsManyThinRingsClosed) {
  constexpr int kRings = 40, kAround = 24, kAcross = 6;
  TriangleMesh mesh;
  for (int ring = 0; ring < kRings; ++ring) {
    const auto first = static_cast<uint32_t>(mesh.positions.size());
    for (int i = 0; i < kAround; ++i) {
      for (int j = 0; j < kAcross; ++j) {
        const double a = 2 * std::numbers::pi * i / kAround, b = 2 * std::numbers::pi * j / kAcross;
        const double radius = 1 + 0.05 * std::cos(b) * (1 + 0.1 * (ring % 7));
        mesh.positions.emplace_back(3 * ring + radius * std::cos(a), radius * std::sin(a),
                                    0.05 * std::sin(b));
        mesh.colors.push_back({1, 2, 3});
        const auto at = [&](int k, int l) {
          return first + static_cast<uint32_t>((k % kAround) * kAcross + l % kAcross);
        };
        mesh.triangles.push_back({at(i, j), at(i + 1, j), at(i, j + 1)});
        mesh.triangles.push_back({at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)});
      }
    }
  }
  ASSERT_TRUE(testing::ShapeOf(mesh).is_closed);
  for (const int64_t most : {4000, 1000, 400}) {
    TriangleMesh merged = mesh;
    Simplify(most, merged);
    EXPECT_LT(merged.num_triangles(), mesh.num_triangles() / 2);
    EXPECT_TRUE(testing::ShapeOf(merged).is_closed) << most;
    EXPECT_EQ(merged.colors.size(), merged.positions.size());
    EXPECT_EQ(merged.normals.size(), merged.positions.size());
  }
}

TEST(Simplify, KeepsTheBorderOfAnOpenMesh) {
  TriangleMesh mesh = Ball(40, 40);
  std::erase_if(mesh.triangles,
                [&mesh](const auto& triangle) { return mesh.positions[triangle[0]].y() > 0.5f; });
  Simplify(300, mesh);
  EXPECT_LE(mesh.num_triangles(), 300);
  EXPECT_EQ(testing::ShapeOf(mesh).euler, 1);
}

TEST(Simplify, LeavesASmallMeshAlone) {
  TriangleMesh mesh = Ball(10, 10);
  const TriangleMesh before = mesh;
  Simplify(mesh.num_triangles(), mesh);
  EXPECT_EQ(mesh.triangles, before.triangles);
  TriangleMesh empty;
  Simplify(0, empty);
  EXPECT_EQ(empty.num_triangles(), 0);
}

}  // namespace
}  // namespace pepeseg
