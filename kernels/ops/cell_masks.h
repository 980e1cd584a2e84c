#pragma once

#include <cstdint>

#include "kernels/buffer.h"

// Arguments of the ops on masks of cells, as UpscaleMasks (prompt_network.h) makes them: which are
// duplicates, and their pixels at the photograph's size (METHOD.md section 6).

namespace pepeseg {

// Drops candidates that a better one makes needless. They are examined in order: a candidate is
// kept unless its IoU with one that was kept exceeds max_iou; a filler is dropped also where a kept
// mask holds its cell.
struct SuppressMasksArgs {
  int words = 0;                                // of a mask
  DeviceSpan<const uint32_t> bits = {};         // [masks, words] one bit a cell
  DeviceSpan<const int32_t> candidates = {};    // [candidates] index of the mask, the best first
  DeviceSpan<const int32_t> areas = {};         // [candidates] set bits of the mask
  DeviceSpan<const int32_t> filler_cells = {};  // [candidates] bit of a filler; -1: not a filler
  double max_iou = 0;                           // 0 < max_iou < 1
  // Written.
  DeviceSpan<uint8_t> kept = {};        // [candidates] 0 or 1
  DeviceSpan<uint32_t> kept_bits = {};  // [candidates, words] the kept masks, in order; the rest is
                                        // unspecified
};

// Enlarges masks of logits to the photograph's size, as OpenCV's warpAffine does with bilinear
// interpolation: coordinates are rounded to 1/32 cell, cells outside repeat the border. Pixels with
// a positive logit that are not ignored are returned as runs: they do not cross scanlines and are
// in reading order.
struct EnlargeMasksArgs {
  int extent = 0;             // cells from a scanline of a mask to the next
  int width = 0, height = 0;  // cells that show the photograph
  double cells_per_pixel = 0;
  int photo_width = 0, photo_height = 0;
  DeviceSpan<const int8_t> quarters = {};  // [masks, extent, extent]
  DeviceSpan<const int32_t> masks = {};    // [enlarged] index of the mask
  DeviceSpan<const uint8_t> ignored = {};  // [photo_height, photo_width] not 0: ignored; or empty
  // Written; sized by the op, which waits on the host for the number of runs.
  Buffer<int32_t>* first_run = nullptr;  // [enlarged * photo_height + 1] of each scanline
  Buffer<int32_t>* runs = nullptr;       // [runs, 2] x of the first pixel, and after the last
};

}  // namespace pepeseg
