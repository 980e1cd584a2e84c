#pragma once

#include <cstdint>

#include "kernels/buffer.h"
#include "kernels/gaussian_planes.h"

namespace pepeseg {

// How many rows of each kind density control made; read on the host.
struct DensityCounts {
  int64_t num_rows = 0;  // after it
  int64_t num_cloned = 0, num_split = 0, num_pruned = 0;
};

// Adaptive density control (Kerbl et al. 2023, section 5): the rows that follow on the present
// ones, in Morton order of their means, so that neighbours in space become neighbours in memory. A
// Gaussian fainter than min_opacity goes. Of the others, those whose mean gradient reaches
// min_gradient are densified, while there is room for them below max_count the largest gradients
// first (equal ones by index): a small one is cloned in place, a large one is replaced by two that
// are drawn from it and are 1.6 times smaller. The host waits for the counts.
struct PlanDensityArgs {
  ConstGaussianPlanes gaussians;            // planes up to the opacity are read
  DeviceSpan<const float> mean2d_grad_sum;  // [N], see DensityStats
  DeviceSpan<const int32_t> num_visible;    // [N] likewise
  float min_gradient = 0;                   // of the sum divided by num_visible
  float clone_size = 0;                     // scene units: one with a larger deviation is split
  float min_opacity = 0;                    // [0, 1)
  int64_t max_count = 0;                    // Gaussians
  uint32_t seed = 0;                        // of the children
  Buffer<int32_t>* source = nullptr;        // [rows] <- row of `gaussians`, sized by the op
  Buffer<uint8_t>* is_new = nullptr;        // [rows] no moments of its own, sized by the op
  Buffer<float>* mean_log_scale = nullptr;  // [6, rows] planes kMeanPlane to 5, sized by the op
  DensityCounts* counts = nullptr;
};

// Rows in another order or number: row i of `to` becomes row source[i] of `from`.
struct GatherRowsArgs {
  DeviceSpan<const int32_t> source;        // [to.count], each in [0, from.count)
  DeviceSpan<const uint8_t> is_zero = {};  // [to.count] where set, zeros instead; may be empty
  ConstGaussianPlanes from;
  GaussianPlanes to;  // of the same degree; must not overlap `from`
  // A number a row that goes along, as the step counts do with the moments; may be empty.
  DeviceSpan<const int32_t> number_from = {};
  DeviceSpan<int32_t> number_to = {};
};

}  // namespace pepeseg
