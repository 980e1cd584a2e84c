#pragma once

#include <cstdint>

#include "kernels/buffer.h"
#include "kernels/cuda_scratch.h"

namespace pepeseg {

// A visible Gaussian, projected: what the blend step reads of it.
struct Splat {
  float x, y;                       // mean in pixels (pixel centres at integer + 0.5)
  float root_xx, root_xy, root_yy;  // of the inverse dilated 2D covariance, see math/blend.h
  float opacity;                    // (0, 1)
  float r, g, b;                    // colour seen from this camera, >= 0
  float depth;                      // z in the camera frame, or 1 / z: RenderScratch::inverse_depth
  float min_power;                  // -log2(255 opacity): below it the splat is skipped
  float half_height;                // pixels: rows farther than this from y are out of reach
};

// d loss / d Splat, summed over the pixels of one view.
struct SplatGrad {
  float x, y;
  float conic_xx, conic_xy, conic_yy;
  float opacity;
  float r, g, b;
  float depth;  // with respect to z in either case
};

// Tiles first_tile .. first_tile + count, side by side, that a splat reaches.
struct TileRun {
  int32_t first_tile;
  int32_t count;
};

// Index into RenderScratch::counters, each of the last render (or its backward).
enum RenderCounter {
  kNumVisible,              // Gaussians that touch at least one tile
  kNumCulledDegenerate,     // not finite or not positive: quaternion norm, scale, projection
  kNumTileEntries,          // (Gaussian, tile) pairs
  kNumSkippedGradientRows,  // rows whose gradient was not finite: left out of the update
  kNumVoidRenders,          // since the scratch was made: see RenderArgs::entry_room
  kNumRenderCounters,
};

// What one render leaves for its backward pass and for row queries. The caller owns it and passes
// the same one to Render and to the ops that follow; the backend sizes and fills it. One scratch
// serves one render at a time. Named by index space; "visible" counts Gaussians that touch a tile,
// in the order of their index; "entry" counts (Gaussian, tile) pairs, by tile and then by depth
// (equal depths by index).
struct RenderScratch {
  int width = 0;
  int height = 0;
  int num_tiles_x = 0;
  int num_tiles_y = 0;
  bool inverse_depth = false;  // of RenderArgs: the splats' depth is 1 / z, the order is by z
  bool for_backward = false;   // of RenderArgs

  Buffer<int32_t> visible_gaussian;   // [visible] -> Gaussian
  Buffer<Splat> visible_splat;        // [visible]
  Buffer<SplatGrad> visible_grad;     // [visible], written by RenderBackward
  Buffer<int32_t> tile_first_entry;   // [tiles + 1]
  Buffer<int32_t> entry_visible;      // [entries] -> visible
  Buffer<float> pixel_transmittance;  // [H * W], after the last Gaussian that was blended
  Buffer<int32_t> pixel_last_entry;   // [H * W], within the tile: entries before it were seen
  Buffer<int64_t> counters;           // [kNumRenderCounters]

  // Gradients have one slot per entry, grouped by visible, so that they are summed in a fixed
  // order.
  Buffer<int32_t> visible_first_slot;  // [visible + 1]
  Buffer<int32_t> entry_slot;          // [entries]
  Buffer<SplatGrad> slot_grad;         // [entries], CPU

  CudaScratch cuda;

  // Only within one render. Candidates passed the projection, compacted within their chunk.
  Buffer<int32_t> candidate_gaussian;   // [gaussians]
  Buffer<Splat> candidate_splat;        // [gaussians]
  Buffer<int32_t> candidate_num_tiles;  // [gaussians]
  Buffer<int32_t> candidate_num_runs;   // [gaussians]
  Buffer<int32_t> visible_first_run;    // [visible + 1]
  Buffer<TileRun> runs;                 // [runs]
  Buffer<uint64_t> sort_keys;           // [2, visible]
};

}  // namespace pepeseg
