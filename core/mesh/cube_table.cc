#include "core/mesh/cube_table.h"

#include <bit>
#include <cassert>
#include <cstddef>

namespace pepeseg {
namespace {

int EdgeBetween(int corner, int other) {
  const int axis = std::countr_zero(static_cast<unsigned>(corner ^ other));
  const int from = corner & other;
  for (int edge = 0; edge < 12; ++edge) {
    if (kCubeEdges[edge].axis == axis && kCubeEdges[edge].from == from) return edge;
  }
  return -1;
}

// Returns whether both edges of the cube lie in one of its faces.
bool ShareFace(int a, int b) {
  for (int axis = 0; axis < 3; ++axis) {
    if (kCubeEdges[a].axis == axis || kCubeEdges[b].axis == axis) continue;
    if (((kCubeEdges[a].from ^ kCubeEdges[b].from) >> axis & 1) == 0) return true;
  }
  return false;
}

// Sets next[e] to the edge that follows edge e on the surface, in each face, so that what is
// inside is on its left, seen from outside the cube.
std::array<int, 12> LinesOf(int inside) {
  std::array<int, 12> next;
  next.fill(-1);
  for (int axis = 0; axis < 3; ++axis) {
    const int u = 1 << (axis + 1) % 3, v = 1 << (axis + 2) % 3;
    for (int side = 0; side < 2; ++side) {
      const int base = side << axis;
      std::array<int, 4> around = {base, base | u, base | u | v, base | v};  // seen from outside,
      if (side == 0) around = {around[3], around[2], around[1], around[0]};  // counterclockwise
      const auto is_inside = [&](int i) { return (inside >> around[i & 3] & 1) != 0; };
      for (int i = 0; i < 4; ++i) {
        if (!is_inside(i) || is_inside(i + 1)) continue;
        int first = i;  // of the corners inside that end at i
        while (is_inside(first + 3)) first += 3;
        const int entered = EdgeBetween(around[(first + 3) & 3], around[first & 3]);
        next[entered] = EdgeBetween(around[i], around[(i + 1) & 3]);
      }
    }
  }
  return next;
}

// Divides the polygon first..last of a loop into triangles whose edges within the cube lie in none
// of its faces. Returns false, and leaves `triangles` as they were, if there is no such division.
bool Divide(const std::vector<uint8_t>& loop, size_t first, size_t last, CubeTriangles& triangles) {
  if (last - first < 2) return true;
  const size_t before = triangles.size();
  const auto fits = [&](size_t i, size_t j) {
    return j - i == 1 || j - i == loop.size() - 1 || !ShareFace(loop[i], loop[j]);
  };
  for (size_t middle = first + 1; middle < last; ++middle) {
    if (fits(first, middle) && fits(middle, last) && Divide(loop, first, middle, triangles) &&
        Divide(loop, middle, last, triangles)) {
      triangles.push_back({loop[first], loop[middle], loop[last]});
      return true;
    }
    triangles.resize(before);
  }
  return false;
}

CubeTriangles TrianglesOf(int inside) {
  std::array<int, 12> next = LinesOf(inside);
  CubeTriangles triangles;
  for (int edge = 0; edge < 12; ++edge) {
    std::vector<uint8_t> loop;
    for (int at = edge; next[at] >= 0;) {
      loop.push_back(static_cast<uint8_t>(at));
      const int after = next[at];
      next[at] = -1;
      at = after;
    }
    if (loop.empty()) continue;
    [[maybe_unused]] const bool divided = Divide(loop, 0, loop.size() - 1, triangles);
    assert(divided);
  }
  return triangles;
}

}  // namespace

const std::array<CubeTriangles, 256>& CubeTable() {
  static const auto* const table = [] {
    auto* made = new std::array<CubeTriangles, 256>;
    for (int inside = 0; inside < 256; ++inside) (*made)[inside] = TrianglesOf(inside);
    return made;
  }();
  return *table;
}

}  // namespace pepeseg
