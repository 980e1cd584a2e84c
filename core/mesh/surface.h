#pragma once

#include <cstdint>
#include <vector>

#include "core/scene/triangle_mesh.h"

namespace pepeseg {

// Bytes of a surface for each vertex, with about two triangles, and of what the functions below
// find of it.
inline constexpr int64_t kSurfaceVertexBytes = 100;

// A mesh, without normals, and what is known of its vertices.
struct Surface {
  TriangleMesh mesh;
  std::vector<uint8_t> is_seen;    // [num_vertices] 0: next to a voxel that no view has seen
  std::vector<uint8_t> has_color;  // [num_vertices]
};

// Returns the memory of a mesh, bytes.
int64_t BytesOfTriangles(const TriangleMesh& mesh);

// Removes the connected parts with fewer triangles than `min_share` of those of the largest part,
// and vertices without triangles.
void DropIslands(double min_share, Surface& surface);
// Smooths where nothing was seen, which follows the voxels' steps: moves these vertices towards the
// mean of their neighbours, a few times.
void SmoothUnseen(Surface& surface);
// Gives vertices without colour that of their neighbours; grey where there is none.
void FillColors(Surface& surface);
// Sets the normals: the mean of those of the triangles at a vertex, by area.
void SetNormals(TriangleMesh& mesh);

}  // namespace pepeseg
