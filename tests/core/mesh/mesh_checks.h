#pragma once

#include <Eigen/Geometry>
#include <cstdint>
#include <map>
#include <utility>

#include "core/scene/triangle_mesh.h"

namespace pepeseg::testing {

// What the edges of a mesh say of it.
struct MeshShape {
  bool is_closed = true;  // each edge has two triangles, which go along it in opposite directions
  int64_t euler = 0;      // vertices - edges + triangles
  double volume = 0;      // positive if triangles are counterclockwise seen from outside
};

inline MeshShape ShapeOf(const TriangleMesh& mesh) {
  MeshShape shape;
  std::map<std::pair<uint32_t, uint32_t>, int> lines;  // times that triangles go along it
  for (const std::array<uint32_t, 3>& triangle : mesh.triangles) {
    for (int i = 0; i < 3; ++i) ++lines[{triangle[i], triangle[(i + 1) % 3]}];
    const Eigen::Vector3d a = mesh.positions[triangle[0]].cast<double>();
    const Eigen::Vector3d b = mesh.positions[triangle[1]].cast<double>();
    const Eigen::Vector3d c = mesh.positions[triangle[2]].cast<double>();
    shape.volume += a.dot(b.cross(c)) / 6;
  }
  int64_t num_edges = 0;
  for (const auto& [line, count] : lines) {
    const auto back = lines.find({line.second, line.first});
    if (count != 1 || back == lines.end()) shape.is_closed = false;
    if (back == lines.end() || line.first < line.second) ++num_edges;
  }
  shape.euler = mesh.num_vertices() - num_edges + mesh.num_triangles();
  return shape;
}

}  // namespace pepeseg::testing
