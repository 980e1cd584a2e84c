#pragma once

#include <cuda_runtime_api.h>

#include <cstdint>

#include "kernels/ops/cluster.h"

// The passes of SpanningTree over pairs of points (tree_distances.cu).

namespace pepeseg {

// An edge from a given point: its weight's bits, which order as the weight does, above the point
// that it goes to. The least key is the first edge in the order of edges.
using EdgeKey = uint64_t;
inline constexpr EdgeKey kNoEdge = ~EdgeKey{0};

struct NearestParams {
  const float* points;  // [n, 32]
  int num_points;
  int min_samples, num_nearest;  // num_nearest: min_samples - 1..32
  float* squared;                // [n, num_nearest] out: the nearest others, ascending
  int32_t* point;                // [n, num_nearest] out: -1 and infinite where there are no more
  float* core;                   // [n] out: squared core distance
};
void LaunchNearest(const NearestParams& params, cudaStream_t stream);

struct ScanParams {
  const float* points;       // [n, 32]
  const float* core;         // [n] squared
  const int32_t* component;  // [n]
  const int32_t* row;        // [num_rows] points
  const int32_t* num_rows;   // [1]
  int num_points;
  EdgeKey* least;  // [n] by point, in and out: lowered to the least edge to another component
};
void LaunchScan(const ScanParams& params, cudaStream_t stream);

}  // namespace pepeseg
