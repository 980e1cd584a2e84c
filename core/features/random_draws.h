#pragma once

#include <cstddef>
#include <cstdint>
#include <random>
#include <span>
#include <vector>

#include "core/scene/mask_set.h"

namespace pepeseg {

// Random numbers that are the same with every standard library. The engine is specified by the
// standard, its distributions are not.

// Returns a number that is uniform in (low, high].
inline float DrawBetween(float low, float high, std::mt19937_64& random) {
  const double share = (static_cast<double>(random() >> 11) + 1) * 0x1p-53;
  return static_cast<float>(low + share * (double{high} - low));
}

// Returns a number that is uniform in [0, count), but for a bias of at most count / 2^32. count is
// at most 2^32.
inline size_t DrawIndex(size_t count, std::mt19937_64& random) {
  return static_cast<size_t>((random() >> 32) * count >> 32);
}

// Draws pixels of a view mask by mask, so that a small part gets as many samples as a wall. A
// mask's pixels are kept as runs of consecutive indices, not one by one.
class PixelsByMask {
 public:
  PixelsByMask() = default;
  // pixels: the pixels that may be drawn, y * width + x, ascending. Masks without a scale and masks
  // that cover none of the pixels are never drawn. mask_scales: [num_masks].
  PixelsByMask(const MaskSet& masks, std::span<const float> mask_scales,
               std::span<const int32_t> pixels);

  // Returns true if no mask has a pixel to draw.
  bool empty() const { return masks_.empty(); }
  // Returns the index in `pixels` of a random pixel of a random mask. All masks are equally likely,
  // and so are all pixels of a mask. Must not be called if empty().
  size_t Draw(std::mt19937_64& random) const;

 private:
  // Consecutive entries of `pixels` under one mask.
  struct Run {
    int64_t first = 0;  // index in `pixels`
    int64_t end = 0;    // pixels of the mask up to the end of this run
  };
  // Appends a run, or extends the last one if it continues there.
  static void Append(int64_t first, int64_t count, std::vector<Run>& runs);

  std::vector<std::vector<Run>> masks_;  // runs of each mask, ascending
};

}  // namespace pepeseg
