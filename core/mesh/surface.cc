#include "core/mesh/surface.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <utility>

#include "core/base/disjoint_sets.h"

namespace pepeseg {
namespace {

constexpr int kSmoothingSteps = 20;
constexpr float kSmoothingShare = 0.5f;  // of the way to the neighbours' mean
constexpr uint8_t kNoColor = 128;
constexpr int kColorSteps = 200;  // edges that colours travel
constexpr uint32_t kDropped = UINT32_MAX;

// Moves the elements with a new index to it and drops the others. New indices ascend.
template <typename T>
void Compact(const std::vector<uint32_t>& index, size_t count, std::vector<T>& values) {
  if (values.empty()) return;
  for (size_t i = 0; i < index.size(); ++i) {
    if (index[i] != kDropped) values[index[i]] = values[i];
  }
  values.resize(count);
}

// Calls body(a, b) for both directions of each edge of each triangle.
template <typename Body>
void ForEachNeighbour(const TriangleMesh& mesh, Body body) {
  for (const std::array<uint32_t, 3>& triangle : mesh.triangles) {
    for (int i = 0; i < 3; ++i) {
      body(triangle[i], triangle[(i + 1) % 3]);
      body(triangle[(i + 1) % 3], triangle[i]);
    }
  }
}

}  // namespace

int64_t BytesOfTriangles(const TriangleMesh& mesh) {
  constexpr int64_t kVertexBytes = 2 * sizeof(Eigen::Vector3f) + 3;
  return mesh.num_vertices() * kVertexBytes +
         mesh.num_triangles() * static_cast<int64_t>(sizeof(mesh.triangles[0]));
}

void DropIslands(double min_share, Surface& surface) {
  TriangleMesh& mesh = surface.mesh;
  const auto num_vertices = static_cast<size_t>(mesh.num_vertices());
  DisjointSets parts(num_vertices);
  for (const std::array<uint32_t, 3>& triangle : mesh.triangles) {
    for (int i = 1; i < 3; ++i) parts.Join(triangle[0], triangle[i]);
  }
  std::vector<int64_t> sizes(num_vertices);  // triangles, by representative
  for (const std::array<uint32_t, 3>& triangle : mesh.triangles) {
    ++sizes[parts.Find(triangle[0])];
  }
  const int64_t largest = sizes.empty() ? 0 : *std::ranges::max_element(sizes);
  const double least = std::max(1.0, min_share * static_cast<double>(largest));
  std::vector<uint32_t> index(num_vertices, kDropped);
  uint32_t count = 0;
  for (uint32_t i = 0; i < index.size(); ++i) {
    if (static_cast<double>(sizes[parts.Find(i)]) >= least) index[i] = count++;
  }
  std::erase_if(mesh.triangles, [&index](const std::array<uint32_t, 3>& triangle) {
    return index[triangle[0]] == kDropped;
  });
  for (std::array<uint32_t, 3>& triangle : mesh.triangles) {
    for (uint32_t& vertex : triangle) vertex = index[vertex];
  }
  Compact(index, count, mesh.positions);
  Compact(index, count, mesh.colors);
  Compact(index, count, surface.is_seen);
  Compact(index, count, surface.has_color);
}

void SmoothUnseen(Surface& surface) {
  TriangleMesh& mesh = surface.mesh;
  std::vector<Eigen::Vector3f> sums(mesh.positions.size());
  std::vector<float> counts(mesh.positions.size());
  for (int step = 0; step < kSmoothingSteps; ++step) {
    std::ranges::fill(sums, Eigen::Vector3f::Zero());
    std::ranges::fill(counts, 0.0f);
    ForEachNeighbour(mesh, [&](uint32_t a, uint32_t b) {
      if (surface.is_seen[a] != 0) return;
      sums[a] += mesh.positions[b];
      ++counts[a];
    });
    for (size_t i = 0; i < sums.size(); ++i) {
      if (counts[i] == 0) continue;
      mesh.positions[i] += kSmoothingShare * (sums[i] / counts[i] - mesh.positions[i]);
    }
  }
}

void FillColors(Surface& surface) {
  TriangleMesh& mesh = surface.mesh;
  std::vector<std::array<int32_t, 4>> sums(mesh.positions.size());  // R, G, B, count
  for (int step = 0; step < kColorSteps; ++step) {
    bool filled = false;
    ForEachNeighbour(mesh, [&](uint32_t a, uint32_t b) {
      if (surface.has_color[a] != 0 || surface.has_color[b] == 0) return;
      for (int k = 0; k < 3; ++k) sums[a][k] += mesh.colors[b][k];
      ++sums[a][3];
      filled = true;
    });
    if (!filled) break;
    for (size_t i = 0; i < sums.size(); ++i) {
      if (sums[i][3] == 0) continue;
      for (int k = 0; k < 3; ++k) {
        mesh.colors[i][k] = static_cast<uint8_t>((sums[i][k] + sums[i][3] / 2) / sums[i][3]);
      }
      surface.has_color[i] = 1;
      sums[i] = {};
    }
  }
  for (size_t i = 0; i < sums.size(); ++i) {
    if (surface.has_color[i] == 0) mesh.colors[i] = {kNoColor, kNoColor, kNoColor};
  }
}

void SetNormals(TriangleMesh& mesh) {
  mesh.normals.assign(mesh.positions.size(), Eigen::Vector3f::Zero());
  for (const std::array<uint32_t, 3>& triangle : mesh.triangles) {
    const Eigen::Vector3f& a = mesh.positions[triangle[0]];
    const Eigen::Vector3f normal =
        (mesh.positions[triangle[1]] - a).cross(mesh.positions[triangle[2]] - a);
    for (const uint32_t vertex : triangle) mesh.normals[vertex] += normal;
  }
  for (Eigen::Vector3f& normal : mesh.normals) {
    // Areas are squares of lengths: scaled first, so that none of a tiny mesh underflows.
    const float largest = normal.cwiseAbs().maxCoeff();
    normal = largest > 0 ? (normal / largest).normalized() : Eigen::Vector3f(0, 0, 1);
  }
}

}  // namespace pepeseg
