#pragma once

#include <array>
#include <cstdint>
#include <vector>

namespace pepeseg {

// Marching cubes (Lorensen and Cline, 1987). Corner c of a cube is at x = c & 1, y = c >> 1 & 1,
// z = c >> 2 & 1.

// An edge of a cube: from the corner `from` along an axis to from | 1 << axis.
struct CubeEdge {
  int axis = 0, from = 0;
};
inline constexpr std::array<CubeEdge, 12> kCubeEdges = {{{0, 0},
                                                         {0, 2},
                                                         {0, 4},
                                                         {0, 6},
                                                         {1, 0},
                                                         {1, 1},
                                                         {1, 4},
                                                         {1, 5},
                                                         {2, 0},
                                                         {2, 1},
                                                         {2, 2},
                                                         {2, 3}}};

// The triangles of a cube, each of three edges on which its vertices are, counterclockwise seen
// from outside.
using CubeTriangles = std::vector<std::array<uint8_t, 3>>;

// Returns the triangles of each set of corners inside: bit c for corner c. Where two opposite
// corners of a face are inside and the others are not, the two are separated, in both cubes of the
// face, so that neighbouring cubes fit. No edge of a triangle within a cube lies in a face, so that
// each edge has exactly two triangles: a volume whose border is outside has a closed 2-manifold.
const std::array<CubeTriangles, 256>& CubeTable();

}  // namespace pepeseg
