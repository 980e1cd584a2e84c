#pragma once

#include <cstdint>
#include <span>

#include "kernels/ops/feature.h"

// Arguments of smoothing over the nearest neighbours (METHOD.md section 3, "Smoothing"):
//   fbar_i = normalize(sum over the drawn neighbours j of i of normalize(f_j)).
// Which Gaussians a batch reads is known before any feature is, so the neighbours are drawn and
// listed in advance (NeighborRows, TransposeRows), for many batches at once. N is the number of
// Gaussians, S the number of sampled pixels.

namespace pepeseg {

inline constexpr int kMaxNeighbors = 32;

// The nearest Gaussians of each Gaussian, which is the first of them. A draw selects columns: bit k
// set means that column k takes part.
struct NeighborGraph {
  DeviceSpan<const int32_t> neighbor;  // [N, num_neighbors] -> Gaussian
  int num_neighbors = 0;               // 1..kMaxNeighbors
};

// The draw that selects all columns.
inline uint32_t AllNeighbors(const NeighborGraph& graph) {
  return graph.num_neighbors == 32 ? ~0u : (1u << graph.num_neighbors) - 1u;
}

// The draw that selects the Gaussian itself, so that smoothing leaves its feature as it is.
inline constexpr uint32_t kItselfOnly = 1;

// Lists the drawn neighbours of Gaussians as rows without weights (RowSpan). The Gaussians come in
// groups, one for each batch; all Gaussians of a group share its draw.
struct NeighborRowsArgs {
  NeighborGraph graph;
  DeviceSpan<const int32_t> gaussian;    // [touched] of all groups, each in [0, N)
  std::span<const int32_t> group_first;  // [groups + 1] on the host: index into `gaussian`
  std::span<const uint32_t> drawn;       // [groups] on the host; the same number of bits in each
  Buffer<int32_t>* row_first = nullptr;  // [touched + 1] first entry of each row; sized by the op
  Buffer<int32_t>* row_gaussian = nullptr;  // [touched * bits] neighbours; sized by the op
};

// Smooths the features of some Gaussians. Where a sum is 0, as where all its features are 0, the
// direction has length 0.
struct SmoothFeaturesArgs {
  NeighborGraph graph;
  uint32_t drawn = 0;                  // the draw, as in NeighborRowsArgs
  DeviceSpan<const int32_t> gaussian;  // [touched] in [0, N); empty: every Gaussian
  DeviceSpan<const float> features;    // [N, 32] f
  DeviceSpan<float> smoothed;          // [N, 32] fbar; only the rows of `gaussian` are written
  DeviceSpan<float> inv_length;        // [N] 1 / |sum|; only those of `gaussian` are written
};

// Backward pass from sampled pixels to the sums of SmoothFeatures, for the Gaussians of `columns`.
// FeatureUpdate (of_direction) continues from the sums to the features.
struct SmoothBackwardArgs {
  ColumnSpan columns;                            // of the sampled pixels
  DeviceSpan<const float> pixel_grad;            // [S, 32] d loss / d F
  DeviceSpan<const float> smoothed, inv_length;  // [N, 32] and [N], as written by SmoothFeatures
  DeviceSpan<float> sum_grad;                    // [touched, 32] in the order of columns.gaussian
};

}  // namespace pepeseg
