#pragma once

#include <cstdint>

#include "kernels/buffer.h"

namespace pepeseg {

// The part of RenderScratch that only the CUDA backend uses. Index spaces as there; a bucket is a
// run of one tile's entries.
struct CudaScratch {
  Buffer<int32_t> gaussian_visible;  // [gaussians] -> visible or -1
  Buffer<int32_t> slot_visible;      // [entries] -> visible
  Buffer<float> slot_sums;           // [entries, 10] the gradient before the sum over the tiles

  // For RenderBackward: what a pixel has gathered in the end, and at the end of each bucket, from
  // where the backward pass starts: rgb without background and transmittance; depth only where it
  // is rendered.
  Buffer<float> pixel_color;          // [tiles, 256, 4]
  Buffer<float> pixel_depth;          // [tiles, 256]
  Buffer<int32_t> tile_first_bucket;  // [tiles + 1]
  Buffer<int32_t> tile_order;         // [tiles] those with the most entries first
  Buffer<int32_t> bucket_tile;        // [buckets] -> tile
  Buffer<float> bucket_color;         // [buckets, 256, 4]
  Buffer<float> bucket_depth;         // [buckets, 256]

  // Only within one render.
  Buffer<uint64_t> sort_keys;     // [2, entries] by tile, then by depth
  Buffer<int32_t> unsorted_slot;  // [entries]
};

}  // namespace pepeseg
