#include "core/mesh/simplify.h"

#include <meshoptimizer.h>

#include <algorithm>
#include <array>
#include <compare>
#include <cstddef>
#include <limits>
#include <utility>
#include <vector>

#include "core/base/disjoint_sets.h"
#include "core/mesh/surface.h"

namespace pepeseg {
namespace {

// Memory of meshoptimizer 0.18, with the new vertices and triangles.
constexpr int64_t kBytesOfVertex = 160, kBytesOfTriangle = 96;

// One side of a triangle, from corner `from` to corner `to`: corner 3 t + k is vertex k of triangle
// t.
struct Side {
  uint32_t low, high;  // its vertices
  bool is_up;          // from low to high
  uint32_t from, to;
  friend auto operator<=>(const Side&, const Side&) = default;
};

// Returns the sides of all triangles, sorted: those of an edge follow one another, first those that
// go down.
std::vector<Side> SidesOf(const TriangleMesh& mesh) {
  std::vector<Side> sides;
  sides.reserve(3 * mesh.triangles.size());
  for (uint32_t t = 0; t < mesh.triangles.size(); ++t) {
    for (uint32_t k = 0; k < 3; ++k) {
      const uint32_t from = 3 * t + k, to = 3 * t + (k + 1) % 3;
      const uint32_t a = mesh.triangles[t][k], b = mesh.triangles[t][(k + 1) % 3];
      sides.push_back({std::min(a, b), std::max(a, b), a < b, from, to});
    }
  }
  std::sort(sides.begin(), sides.end());
  return sides;
}

// Calls visit(down, up, index) for each pair of sides of an edge that go in opposite directions;
// index: 0 for the first pair of the edge.
template <class Visit>
void VisitPairs(const std::vector<Side>& sides, const Visit& visit) {
  for (size_t begin = 0, end = 0; begin < sides.size(); begin = end) {
    size_t up = begin;
    while (end < sides.size() && sides[end].low == sides[begin].low &&
           sides[end].high == sides[begin].high) {
      up += sides[end++].is_up ? 0 : 1;
    }
    for (size_t i = 0; begin + i < up && up + i < end; ++i) {
      visit(sides[begin + i], sides[up + i], i);
    }
  }
}

// Gives each fan of triangles around a vertex a vertex of its own, and drops vertices that no
// triangle has. Merging can make two sheets touch in an edge or a vertex, which they share then:
// here each pair of triangles gets its own edge, in the same place (Guéziec et al., "Cutting and
// Stitching", 2001).
void SeparateSheets(TriangleMesh& mesh) {
  DisjointSets corners(3 * mesh.triangles.size());  // of one vertex
  VisitPairs(SidesOf(mesh), [&corners](const Side& down, const Side& up, size_t) {
    corners.Join(down.from, up.to);
    corners.Join(down.to, up.from);
  });
  constexpr uint32_t kNone = std::numeric_limits<uint32_t>::max();
  std::vector<uint32_t> index(3 * mesh.triangles.size(), kNone);  // by the root of a vertex
  std::vector<Eigen::Vector3f> positions;
  std::vector<std::array<uint8_t, 3>> colors;
  for (uint32_t t = 0; t < mesh.triangles.size(); ++t) {
    for (uint32_t k = 0; k < 3; ++k) {
      uint32_t& vertex = mesh.triangles[t][k];
      uint32_t& to = index[corners.Find(3 * t + k)];
      if (to == kNone) {
        to = static_cast<uint32_t>(positions.size());
        positions.push_back(mesh.positions[vertex]);
        colors.push_back(mesh.colors[vertex]);
      }
      vertex = to;
    }
  }
  mesh.positions = std::move(positions);
  mesh.colors = std::move(colors);
}

// Splits the triangle of the side at its middle, the vertex `middle`.
void SplitAt(const Side& side, uint32_t middle, TriangleMesh& mesh) {
  auto& triangle = mesh.triangles[side.from / 3];
  std::array<uint32_t, 3> second = triangle;
  second[side.from % 3] = middle;
  triangle[side.to % 3] = middle;
  mesh.triangles.push_back(second);
}

// Splits all but one of the edges between the same two vertices at their middles. Returns whether
// there were any.
bool SplitDoubleEdges(TriangleMesh& mesh) {
  std::vector<uint8_t> is_split(mesh.triangles.size());  // once at a time
  bool found = false;
  VisitPairs(SidesOf(mesh), [&](const Side& down, const Side& up, size_t index) {
    if (index == 0) return;
    found = true;
    uint8_t& of_down = is_split[down.from / 3];
    uint8_t& of_up = is_split[up.from / 3];
    if (of_down != 0 || of_up != 0) return;
    of_down = of_up = 1;
    const auto middle = static_cast<uint32_t>(mesh.positions.size());
    mesh.positions.push_back((mesh.positions[up.low] + mesh.positions[up.high]) / 2);
    mesh.colors.push_back(mesh.colors[up.low]);
    SplitAt(down, middle, mesh);
    SplitAt(up, middle, mesh);
  });
  return found;
}

// Merges vertices until `max_triangles` are left, if it can be done.
void MergeVertices(int64_t max_triangles, TriangleMesh& mesh) {
  // An error as large as the mesh: only the number of triangles is a limit.
  constexpr float kAnyError = 1;
  std::vector<std::array<uint32_t, 3>> fewer(mesh.triangles.size());
  const size_t left = meshopt_simplify(
      fewer.front().data(), mesh.triangles.front().data(), 3 * mesh.triangles.size(),
      mesh.positions.front().data(), mesh.positions.size(), sizeof(Eigen::Vector3f),
      3 * static_cast<size_t>(max_triangles), kAnyError, /*options=*/0, nullptr);
  fewer.resize(left / 3);
  mesh.triangles = std::move(fewer);
}

}  // namespace

int64_t BytesToSimplify(const TriangleMesh& mesh) {
  return kBytesOfVertex * mesh.num_vertices() + kBytesOfTriangle * mesh.num_triangles();
}

void Simplify(int64_t max_triangles, TriangleMesh& mesh) {
  if (mesh.num_triangles() <= max_triangles) return;
  // Split edges take it over the limit by a hundredth or so, which is merged again.
  constexpr int kMostPasses = 4;
  int64_t target = max_triangles;
  for (int pass = 0; pass < kMostPasses && mesh.num_triangles() > max_triangles; ++pass) {
    MergeVertices(target, mesh);
    do {
      SeparateSheets(mesh);
    } while (SplitDoubleEdges(mesh));
    target = std::max<int64_t>(0, target - 2 * (mesh.num_triangles() - max_triangles));
  }
  SetNormals(mesh);
}

}  // namespace pepeseg
