#pragma once

#include <cstdint>

#include "kernels/ops/feature.h"

// What the inner loops of SpanningTree work on (kernels/cpu/simd/spanning_tree.cc). Points stand as
// columns in groups of kTreeColumns, channel by channel: [groups, 32, kTreeColumns].

namespace pepeseg {

inline constexpr int kTreeColumns = 16;  // a group, worked on at once
inline constexpr int kTreeRows = 8;      // rows are taken in multiples of these
inline constexpr int kNearestRows = 32;  // rows of a task: the columns are read once for them

struct Neighbour {
  float squared;
  int32_t point;  // -1: none, at an infinite distance
};

struct NearestJob {
  const float* points;   // [num_points, 32]
  const float* columns;  // the same; what is behind them in the last group is not read
  int32_t num_points;
  int num_nearest;     // k
  Neighbour* nearest;  // [num_points, k] out: the nearest others, ascending; infinite ones left out
};

// Points outside of the tree as columns, points that have just joined it as rows.
struct RelaxJob {
  const float* columns;
  const float* core;  // [columns] squared
  // [columns] in and out: the least edge to the tree, and the point of the tree that it goes to.
  float* reach;
  int32_t* from;
  const float* rows;          // [num_rows, 32]
  const float* row_core;      // [num_rows]
  const int32_t* row_points;  // [num_rows]
  int num_rows;               // in multiples of kTreeRows
};

struct ColumnRange {
  int32_t first, end;  // multiples of kTreeColumns
};

}  // namespace pepeseg
