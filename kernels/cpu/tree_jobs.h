#pragma once

#include <cstdint>

#include "kernels/ops/feature.h"

// Tasks of the inner loops of SpanningTree (kernels/cpu/simd/spanning_tree.cc). Points are stored
// as columns in groups of kTreeColumns, channel by channel: [groups, 32, kTreeColumns]. Distances
// are squared.

namespace pepeseg {

inline constexpr int kTreeColumns = 16;  // points of a group
inline constexpr int kTreeRows = 8;      // numbers of rows are multiples of this
inline constexpr int kNearestRows = 32;  // rows of a task, for which the columns are read once

struct Neighbour {
  float squared;
  int32_t point;  // -1: none; the distance is then infinite
};

// Finds the nearest neighbours of some points.
struct NearestJob {
  const float* points;   // [num_points, 32]
  const float* columns;  // the same points; the last group's padding is ignored
  int32_t num_points;
  int num_nearest;     // k
  Neighbour* nearest;  // [num_points, k] out: the nearest other points, ascending; none at infinity
};

// Points outside the tree as columns, points that have just joined it as rows.
struct RelaxJob {
  const float* columns;
  const float* core;  // [columns] squared
  // [columns] in and out: the squared length of the least edge to the tree, and its end in the
  // tree.
  float* reach;
  int32_t* from;
  const float* rows;          // [num_rows, 32]
  const float* row_core;      // [num_rows]
  const int32_t* row_points;  // [num_rows]
  int num_rows;               // a multiple of kTreeRows
};

struct ColumnRange {
  int32_t first, end;  // multiples of kTreeColumns
};

}  // namespace pepeseg
