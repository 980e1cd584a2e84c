#include "core/mesh/simplify.h"

#include <meshoptimizer.h>

#include <limits>
#include <utility>
#include <vector>

#include "core/mesh/surface.h"

namespace pepeseg {
namespace {

// Memory of meshoptimizer 0.18, with the new vertices and triangles.
constexpr int64_t kBytesOfVertex = 160, kBytesOfTriangle = 96;

// Removes the vertices that no triangle has.
void DropUnused(TriangleMesh& mesh) {
  constexpr uint32_t kUnused = std::numeric_limits<uint32_t>::max();
  std::vector<uint32_t> index(mesh.positions.size(), kUnused);
  uint32_t count = 0;
  std::vector<Eigen::Vector3f> positions;
  std::vector<std::array<uint8_t, 3>> colors;
  for (auto& triangle : mesh.triangles) {
    for (uint32_t& vertex : triangle) {
      if (index[vertex] == kUnused) {
        index[vertex] = count++;
        positions.push_back(mesh.positions[vertex]);
        colors.push_back(mesh.colors[vertex]);
      }
      vertex = index[vertex];
    }
  }
  mesh.positions = std::move(positions);
  mesh.colors = std::move(colors);
}

}  // namespace

int64_t BytesToSimplify(const TriangleMesh& mesh) {
  return kBytesOfVertex * mesh.num_vertices() + kBytesOfTriangle * mesh.num_triangles();
}

void Simplify(int64_t max_triangles, TriangleMesh& mesh) {
  if (mesh.num_triangles() <= max_triangles) return;
  // An error as large as the mesh: only the number of triangles is a limit.
  constexpr float kAnyError = 1;
  const size_t num_indices = 3 * mesh.triangles.size();
  std::vector<std::array<uint32_t, 3>> fewer(mesh.triangles.size());
  const size_t left = meshopt_simplify(
      fewer.front().data(), mesh.triangles.front().data(), num_indices,
      mesh.positions.front().data(), mesh.positions.size(), sizeof(Eigen::Vector3f),
      3 * static_cast<size_t>(max_triangles), kAnyError, /*options=*/0, nullptr);
  fewer.resize(left / 3);
  mesh.triangles = std::move(fewer);
  DropUnused(mesh);
  SetNormals(mesh);
}

}  // namespace pepeseg
