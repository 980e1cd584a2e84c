#pragma once

#include <cstdint>

#include "kernels/buffer.h"

namespace pepeseg {

// The part of RenderScratch that only the CUDA backend uses. Index spaces are those of
// RenderScratch. A bucket is a run of up to 128 entries of one tile (kernels/cuda/blend_tile.cuh).
struct CudaScratch {
  Buffer<int32_t> gaussian_visible;  // [gaussians] -> visible, or -1
  Buffer<int32_t> slot_visible;      // [entries] -> visible
  Buffer<float> slot_sums;           // [entries, 10] gradients before the sum over the tiles

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

}  // namespace pepeseg
