#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <vector>

namespace pepeseg {

// Triangles with shared vertices, in the coordinates of the model. The vertices of a triangle are
// counterclockwise seen from outside.
struct TriangleMesh {
  std::vector<Eigen::Vector3f> positions;          // scene units
  std::vector<Eigen::Vector3f> normals;            // [num_vertices()] of length 1, outwards
  std::vector<std::array<uint8_t, 3>> colors;      // [num_vertices()] sRGB
  std::vector<std::array<uint32_t, 3>> triangles;  // indices of vertices

  int64_t num_vertices() const { return static_cast<int64_t>(positions.size()); }
  int64_t num_triangles() const { return static_cast<int64_t>(triangles.size()); }
};

}  // namespace pepeseg
