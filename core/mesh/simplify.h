#pragma once

#include <cstdint>

#include "core/scene/triangle_mesh.h"

namespace pepeseg {

// Returns the host's memory that Simplify takes next to the mesh, bytes.
int64_t BytesToSimplify(const TriangleMesh& mesh);

// Merges vertices until at most `max_triangles` are left, where the surface changes least first
// (quadric errors, Garland and Heckbert, "Surface Simplification Using Quadric Error Metrics",
// 1997; by meshoptimizer). Vertices that stay keep place and colour; normals are those of the new
// triangles. Borders and large holes stay, so that more triangles may be left. A closed mesh stays
// closed. Where sheets come to touch, each keeps vertices of its own, in the same place. Unchanged
// if it has no more than max_triangles.
void Simplify(int64_t max_triangles, TriangleMesh& mesh);

}  // namespace pepeseg
