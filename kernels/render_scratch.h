#pragma once

#include <cstdint>

#include "kernels/buffer.h"

namespace pepeseg {

// A visible Gaussian as the blend step reads it, projected to the image.
struct Splat {
  float x, y;                       // mean in pixels (pixel centres at integer + 0.5)
  float root_xx, root_xy, root_yy;  // root of the inverse 2D covariance, see PowerRoot
  float opacity;                    // (0, 1); with dropout up to 1 / (1 - share)
  float r, g, b;                    // colour seen from this camera, >= 0
  float depth;                      // z in the camera frame, or 1 / z after inverse_depth
  float min_power;                  // -log2(255 opacity); below it the splat is skipped
  float half_height;                // pixels; rows farther than this from y are out of reach
};

// d loss / d Splat, summed over the pixels of one view. The conic is the inverse dilated 2D
// covariance.
struct SplatGrad {
  float x, y;
  float conic_xx, conic_xy, conic_yy;
  float opacity;
  float r, g, b;
  float depth;  // with respect to z, after a render of inverse depth, too
  // No gradient: the sum of (d loss / d ln g)^2, where g is the splat's falloff at a pixel, in
  // (0, 1], and only the gradient of the colour counts. Density control draws by it.
  float squares;
};

// Tiles [first_tile, first_tile + count), next to each other in one row, that a splat reaches.
struct TileRun {
  int32_t first_tile;
  int32_t count;
};

// Index into RenderScratch::counters. The counters are those of the last Render (or the ops after
// it) with the scratch.
enum RenderCounter {
  kNumVisible,  // Gaussians that touch at least one tile
  // Gaussians culled because depth, projection, opacity, colour or quaternion norm is not finite,
  // beyond 1e30, or not positive where it must be.
  kNumCulledDegenerate,
  kNumTileEntries,          // (Gaussian, tile) pairs
  kNumSkippedGradientRows,  // Gaussians left out of Update because their gradient was not finite
  kNumOverflowedRenders,    // overflowed renders since the scratch was made, see RenderArgs; CPU: 0
  kNumRenderCounters,
};

// The part of RenderScratch that only the CUDA backend uses. Index spaces are those of
// RenderScratch. A bucket is a run of up to 128 entries of one tile (kernels/cuda/blend_tile.cuh).
struct CudaScratch {
  Buffer<int32_t> gaussian_visible;  // [gaussians] -> visible, or -1
  Buffer<int32_t> slot_visible;      // [entries] -> visible
  Buffer<float> slot_sums;           // [entries, 12] gradients before the sum over the tiles

  // For RenderBackward: what each pixel has accumulated at the end of its tile and at the end of
  // each bucket, so that the backward pass starts at all buckets at once. Colour is rgb
  // and transmittance. Depth is kept only when it is rendered.
  Buffer<float> pixel_color;          // [tiles, 256, 4]
  Buffer<float> pixel_depth;          // [tiles, 256]
  Buffer<int32_t> tile_first_bucket;  // [tiles + 1]
  Buffer<int32_t> tile_order;         // [tiles] the tiles, those with the most entries first
  Buffer<int32_t> bucket_tile;        // [buckets] -> tile
  Buffer<float> bucket_color;         // [buckets, 256, 4]
  Buffer<float> bucket_depth;         // [buckets, 256]

  // Used only within one Render.
  Buffer<uint64_t> sort_keys;     // [2, entries] tile above depth
  Buffer<int32_t> unsorted_slot;  // [entries]
};

// What a render keeps for its backward pass and for row queries. The caller owns it and passes the
// same one to Render and to the ops that follow; the backend sizes and fills it. One scratch serves
// one render at a time, and one thread.
//
// Buffers are named by their index space. "visible" counts the Gaussians that touch a tile, in the
// order of their index. "entry" counts (Gaussian, tile) pairs, by tile and then by depth (equal
// depths by index). Tiles have 16x16 pixels and are counted row by row.
struct RenderScratch {
  int width = 0;   // of the view, pixels
  int height = 0;  // pixels
  int num_tiles_x = 0;
  int num_tiles_y = 0;
  bool inverse_depth = false;  // see RenderArgs: Splat::depth is 1 / z; the order is by z
  bool for_backward = false;   // see RenderArgs

  Buffer<int32_t> visible_gaussian;   // [visible] -> Gaussian
  Buffer<Splat> visible_splat;        // [visible]
  Buffer<SplatGrad> visible_grad;     // [visible], written by RenderBackward
  Buffer<int32_t> tile_first_entry;   // [tiles + 1]
  Buffer<int32_t> entry_visible;      // [entries] -> visible
  Buffer<float> pixel_transmittance;  // [H * W] after the last Gaussian that was blended
  Buffer<int32_t> pixel_last_entry;   // [H * W] end of the entries of the tile that it has seen
  Buffer<int64_t> counters;           // [kNumRenderCounters] (CUDA: one more)

  // Each entry has a slot for its gradient. Slots are grouped by visible, so that they are summed
  // in a fixed order.
  Buffer<int32_t> visible_first_slot;  // [visible + 1]
  Buffer<int32_t> entry_slot;          // [entries]
  Buffer<SplatGrad> slot_grad;         // [entries] CPU only
  // [entries] for RenderBackward, CPU only: the blocks of 4x4 pixels in which the entry was blended
  // (ImageColors, kernels/cpu/simd_kernels.h).
  Buffer<uint16_t> entry_blocks;

  CudaScratch cuda;

  // Used only within one Render of the CPU backend. Candidates are the Gaussians that passed the
  // projection, compacted within their chunk.
  Buffer<int32_t> candidate_gaussian;   // [gaussians]
  Buffer<Splat> candidate_splat;        // [gaussians]
  Buffer<int32_t> candidate_num_tiles;  // [gaussians]
  Buffer<int32_t> candidate_num_runs;   // [gaussians]
  Buffer<int32_t> visible_first_run;    // [visible + 1]
  Buffer<TileRun> runs;                 // [runs]
  Buffer<uint64_t> sort_keys;           // [2, visible]
};

}  // namespace pepeseg
