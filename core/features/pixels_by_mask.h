#pragma once

#include <cstdint>
#include <random>
#include <span>
#include <vector>

#include "core/scene/mask_set.h"

namespace pepeseg {

// The pixels that a view's masks cover, to be drawn mask by mask: so that a small part has as many
// samples as a wall.
class PixelsByMask {
 public:
  PixelsByMask() = default;
  // pixels: y * width + x ascending, those that may be drawn. Masks without a scale (see
  // MaskScales) and those that hold none of the pixels are never drawn.
  PixelsByMask(const MaskSet& masks, std::span<const float> mask_scales,
               std::span<const int32_t> pixels);

  bool empty() const { return masks_.empty(); }
  // The place in `pixels` of one of a mask, each mask as likely as any other, each of its pixels
  // likewise.
  size_t Draw(std::mt19937_64& random) const;

 private:
  // Pixels of a mask that follow each other: where they begin, and how many the mask has up to
  // their end.
  struct Run {
    int64_t first = 0;
    int64_t end = 0;
  };
  static void Append(int64_t first, int64_t count, std::vector<Run>& runs);

  std::vector<std::vector<Run>> masks_;  // ascending
};

}  // namespace pepeseg
