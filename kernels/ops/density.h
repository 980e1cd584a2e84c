#pragma once

#include <cstdint>

#include "kernels/buffer.h"
#include "kernels/gaussian_planes.h"

// Arguments of density control in stage one (METHOD.md section 1, "Density"). N is the number of
// Gaussians before the op.

namespace pepeseg {

// Result of PlanDensity, on the host.
struct DensityCounts {
  int64_t num_rows = 0;  // Gaussians after density control
  // Gaussians that became two in place, that were replaced by two smaller ones, and that were
  // removed.
  int64_t num_cloned = 0, num_split = 0, num_pruned = 0;
};

// Adaptive density control (Kerbl et al. 2023, section 5). Lists the Gaussians that follow the
// present ones, in Morton order of their means, so that neighbours in space are neighbours in
// memory. GatherRows then moves the parameters.
//
// A Gaussian with an opacity below min_opacity, or NaN, is pruned; so is one with a standard
// deviation above max_size, or whose children would have one if it is to be split. Of the others,
// those with a mean gradient of at least min_gradient are densified, as far as max_count has room.
// A small Gaussian is cloned in place; a large one is split: children are drawn from it that
// are 1.6 times smaller (kernels/math/density.h).
//
// The host waits for the counts. On an error the outputs are unspecified.
struct PlanDensityArgs {
  ConstGaussianPlanes gaussians;            // planes up to kOpacityPlane are read
  DeviceSpan<const float> mean2d_grad_sum;  // [N] see DensityStats
  DeviceSpan<const float> square_sum;       // [N] see DensityStats; read if `draws`
  DeviceSpan<const int32_t> num_visible;    // [N] see DensityStats
  float min_gradient = 0;  // of mean2d_grad_sum / num_visible, which is 0 for a Gaussian never seen
  float clone_size = 0;    // scene units; a Gaussian is split if a standard deviation exceeds it
  float min_opacity = 0;   // [0, 1); 0 prunes none
  float max_size = 0;      // scene units; see above. 0: none is too large
  int64_t max_count = 0;   // Gaussians to densify up to; does not prune
  // Where there is no room for all. False, as in 3DGS: those with the largest mean gradients are
  // densified, equal ones by index. True: they are drawn without replacement, with odds of
  // square_sum. The largest gradients lie, round after round, where no Gaussian can repair the
  // error, such as at reflections; a draw spreads the growth over the scene.
  bool draws = false;
  // What becomes of a Gaussian that is split. False, as in 3DGS: two children replace it. True: it
  // stays as it is and gets one child, so that the picture changes little.
  bool keeps_parent = false;
  uint32_t seed = 0;                        // of the draw and of the children's positions
  Buffer<int32_t>* source = nullptr;        // [num_rows] -> index in `gaussians`; sized by the op
  Buffer<uint8_t>* is_new = nullptr;        // [num_rows] 1: starts without moments; sized by the op
  Buffer<float>* mean_log_scale = nullptr;  // [6, num_rows] planes 0 to 5; sized by the op
  DensityCounts* counts = nullptr;          // on the host
};

// Reorders Gaussians: Gaussian i of `to` becomes Gaussian source[i] of `from`, in all planes.
struct GatherRowsArgs {
  DeviceSpan<const int32_t> source;  // [to.count] each in [0, from.count); repeats are allowed
  DeviceSpan<const uint8_t> is_zero = {};  // [to.count] non-zero: write zeros; empty: none
  ConstGaussianPlanes from;
  GaussianPlanes to;  // same sh_degree as `from`; must not overlap it
  // One integer a Gaussian that is reordered alike, such as the step counts that belong to moments.
  // Both are empty, or [from.count] and [to.count].
  DeviceSpan<const int32_t> number_from = {};
  DeviceSpan<int32_t> number_to = {};
};

}  // namespace pepeseg
