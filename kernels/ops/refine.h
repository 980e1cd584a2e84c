#pragma once

#include <cstdint>

#include "kernels/buffer.h"
#include "kernels/gaussian_planes.h"
#include "kernels/ops/render.h"

// Arguments of the Gaussian refinement of stage one (METHOD.md section 1, "Refinement").

namespace pepeseg {

// The overlapping masks of a view. Pixels under the same masks share a mask cell, which has a
// bitset with one bit for each mask: bit m % 64 of word m / 64. See MaskSet in
// core/scene/mask_set.h.
struct PatchMap {
  int words = 0;                          // 64-bit words of a bitset
  DeviceSpan<const uint32_t> pixel_cell;  // [H, W] -> mask cell
  DeviceSpan<const uint64_t> cell_bits;   // [num_cells, words] masks of each cell
  DeviceSpan<const int64_t> mask_area;    // [num_masks] pixels; empty: nothing is refined
};

enum RefineCount {
  kNumRefineRanked,      // refinable, visible, with the mean in the image where its depth is known
  kNumRefineCandidates,  // those of them that are nearest to the rendered depth
  kNumRefined,           // made shorter
  kNumRefineSplit,       // outside parts written
  kNumRefineCounts,
};

// Working memory of one call, in the index space "visible" of RenderScratch. The caller owns it;
// the backend sizes and fills it.
struct RefineScratch {
  // [2, visible] the bits of |rendered depth - z|, which order as the number does, above the index.
  // The second half holds them sorted or compacted.
  Buffer<uint64_t> keys;
  Buffer<float> outside_shape;  // [6, visible] as RefineGaussiansArgs::outside_shape
  // What became of each Gaussian. CPU: [visible] -1 unchanged, 0 made shorter, 1 with an outside
  // part. CUDA: [2, visible] 1 with an outside part, else 0; then the running sum of that.
  Buffer<int32_t> outside_position;
};

// Shortens Gaussians that cross the border of a mask (kernels/math/refine.h). Runs after a Render
// of the same Gaussians with the scratch `render`. The moments and step count of a shortened
// Gaussian are set to 0, and it is not refinable again. A candidate that crosses nothing stays
// refinable: another view may show it crossing.
//
// Candidates are the candidate_share of the ranked Gaussians with the smallest gap between their
// own depth and the rendered depth (of the inverses, after a render of inverse depth).
struct RefineGaussiansArgs {
  PinholeView view;
  PatchMap masks;
  DeviceSpan<const float> alpha, depth;  // [H, W] as written by that Render
  double candidate_share = 0.1;          // of the ranked Gaussians, rounded down; [0, 1]
  bool split = false;                    // true: the part outside the mask becomes a Gaussian, too
  const RenderScratch* render = nullptr;
  RefineScratch* scratch = nullptr;
  GaussianPlanes gaussians, moment1, moment2;  // in and out, same count and degree
  DeviceSpan<int32_t> num_steps;               // [N] in and out
  DeviceSpan<int32_t> refinable;               // [N] in and out: 0 or 1
  // The outside parts in the order of their Gaussians; counts[kNumRefineSplit] are written. Parts
  // beyond the capacity are dropped, though their Gaussians are shortened.
  DeviceSpan<int32_t> outside_source;  // [capacity] -> Gaussian
  DeviceSpan<float> outside_shape;     // [6, capacity] mean and log scales, for planes 0 to 5
  DeviceSpan<int64_t> counts;          // [kNumRefineCounts]
};

}  // namespace pepeseg
