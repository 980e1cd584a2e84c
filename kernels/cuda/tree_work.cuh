#pragma once

#include <cuda_runtime_api.h>

#include <cstdint>

#include "kernels/ops/cluster.h"

// The passes of SpanningTree over pairs of points, which tree_distances.cu implements and
// spanning_tree.cu calls.

namespace pepeseg {

// An edge from a given point: the bits of its weight, which order as the weight does, above the
// point that it leads to. Of the edges of a point the least key is the least edge; of equal weights
// it is the one to the point of lowest index.
using EdgeKey = uint64_t;
inline constexpr EdgeKey kNoEdge = ~EdgeKey{0};

// Finds the nearest points and the core distance of each point.
struct NearestParams {
  const float* points;  // [n, 32]
  int num_points;
  int min_samples, num_nearest;  // num_nearest: 1..32, at least min_samples - 1
  float* squared;                // [n, num_nearest] out: the nearest others, ascending
  int32_t* point;                // [n, num_nearest] out: -1 and infinite where there are no more
  float* core;                   // [n] out: squared core distance
};
void LaunchNearest(const NearestParams& params, cudaStream_t stream);

// Finds the least edge from each of some points to another component, over all points.
struct ScanParams {
  const float* points;       // [n, 32]
  const float* core;         // [n] squared
  const int32_t* component;  // [n]
  const int32_t* row;        // [num_rows] the points to be scanned
  const int32_t* num_rows;   // [1]
  int num_points;
  EdgeKey* least;  // [n] by point, in and out: lowered to the least edge to another component
};
void LaunchScan(const ScanParams& params, cudaStream_t stream);

}  // namespace pepeseg
