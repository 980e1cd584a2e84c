#pragma once

#include <cstdint>
#include <span>

#include "kernels/ops/feature.h"

// Features smoothed over the nearest neighbours (METHOD.md section 3, "Smoothing"):
//   fbar_i = normalize(sum over the drawn neighbours j of i of normalize(f_j)).
// Which Gaussians a batch reads is known before any feature is: the neighbours are drawn and listed
// ahead (NeighborRows, TransposeRows), for many batches at once.

namespace pepeseg {

inline constexpr int kMaxNeighbors = 32;

struct NeighborGraph {
  DeviceSpan<const int32_t> neighbor;  // [N, num_neighbors], each its own first
  int num_neighbors = 0;               // 1..kMaxNeighbors
};

// The draw of all columns.
inline uint32_t AllNeighbors(const NeighborGraph& graph) {
  return graph.num_neighbors == 32 ? ~0u : (1u << graph.num_neighbors) - 1u;
}

// Rows of the drawn neighbours of Gaussians, without weights. Column k of the graph takes part for
// all Gaussians of a group where bit k of its draw is set.
struct NeighborRowsArgs {
  NeighborGraph graph;
  DeviceSpan<const int32_t> gaussian;       // [touched]
  std::span<const int32_t> group_first;     // [groups + 1] on the host, into `gaussian`
  std::span<const uint32_t> drawn;          // [groups] on the host, with equally many bits each
  Buffer<int32_t>* row_first = nullptr;     // [touched + 1], sized by the op
  Buffer<int32_t>* row_gaussian = nullptr;  // [touched * bits]
};

// A direction of length 0 where a sum is 0, as where all features are.
struct SmoothFeaturesArgs {
  NeighborGraph graph;
  uint32_t drawn = 0;                  // as of NeighborRows
  DeviceSpan<const int32_t> gaussian;  // [touched]; empty: every one
  DeviceSpan<const float> features;    // [N, 32]
  DeviceSpan<float> smoothed;          // [N, 32], the rows of `gaussian` are written
  DeviceSpan<float> inv_length;        // [N] 1 / |sum|, likewise
};

// From the sampled pixels to the sums of SmoothFeatures, for the Gaussians of the pixels' columns.
struct SmoothBackwardArgs {
  ColumnSpan columns;
  DeviceSpan<const float> pixel_grad;            // [S, 32]
  DeviceSpan<const float> smoothed, inv_length;  // of SmoothFeatures
  DeviceSpan<float> sum_grad;                    // [touched, 32]
};

}  // namespace pepeseg
