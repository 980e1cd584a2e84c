#pragma once

#include <cstdint>

#include "kernels/buffer.h"
#include "kernels/gaussian_planes.h"
#include "kernels/ops/render.h"

// Arguments of the Gaussian refinement of stage one (METHOD.md section 1).

namespace pepeseg {

// The overlapping masks of a view, one bit a mask: see MaskSet of core/scene/mask_set.h.
struct PatchMap {
  int words = 0;                           // 64-bit words of a bitset
  DeviceSpan<const uint32_t> pixel_patch;  // [H, W]
  DeviceSpan<const uint64_t> patch_bits;   // [num_patches, words]
  DeviceSpan<const int64_t> mask_area;     // [num_masks] pixels; empty: nothing is refined
};

enum RefineCount {
  kNumRefineRanked,      // refinable, seen, with the mean in the image where its depth is known
  kNumRefineCandidates,  // the nearest to the rendered depth among them
  kNumRefined,           // made shorter
  kNumRefineSplit,       // outside parts written
  kNumRefineCounts,
};

// What one call needs, by the index space of RenderScratch's "visible". The backend sizes and fills
// it.
struct RefineScratch {
  Buffer<uint64_t> keys;             // [2, visible] |rendered depth - z| as bits, then the index
  Buffer<float> outside_shape;       // [6, visible]
  Buffer<int32_t> outside_position;  // [2, visible] 1 where there is an outside part; their sum
};

// Shortens Gaussians that cross the border of a mask, after Render with `render`, which must be of
// the same Gaussians: their moments and step counts start at 0, and they are not refinable again.
// One that was looked at and crosses nothing stays refinable: another view may show it crossing.
struct RefineGaussiansArgs {
  PinholeView view;
  PatchMap masks;
  DeviceSpan<const float> alpha, depth;  // [H, W] of that render
  double candidate_share = 0.1;          // of those ranked, by |rendered depth - z|; rounds down
  bool split = false;                    // the part outside the mask becomes a Gaussian too
  bool scale_all_axes = false;           // by 0.8 of the share, not only the axis that crosses
  const RenderScratch* render = nullptr;
  RefineScratch* scratch = nullptr;
  GaussianPlanes gaussians, moment1, moment2;  // in and out
  DeviceSpan<int32_t> num_steps;               // [N] in and out
  DeviceSpan<int32_t> refinable;               // [N] in and out: 0 or 1
  // The outside parts in the order of their Gaussians: those beyond the room are left out.
  DeviceSpan<int32_t> outside_source;  // [room] -> Gaussian
  DeviceSpan<float> outside_shape;     // [6, room] mean and log scales, for planes 0 to 5
  DeviceSpan<int64_t> counts;          // [kNumRefineCounts]
};

}  // namespace pepeseg
