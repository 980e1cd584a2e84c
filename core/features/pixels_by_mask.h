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
  // pixels: y * width + x, those that may be drawn, each once. Masks without a scale (see
  // MaskScales) and those that hold none of the pixels are never drawn.
  PixelsByMask(const MaskSet& masks, std::span<const float> mask_scales,
               std::span<const int32_t> pixels);

  bool empty() const { return masks_.empty(); }
  // A pixel of a mask, each mask as likely as any other, each of its pixels likewise.
  int32_t Draw(std::mt19937_64& random) const;

 private:
  // A patch of a mask: where its pixels begin, and how many the mask has up to its end.
  struct Run {
    int32_t first = 0;
    int64_t end = 0;
  };
  std::vector<int32_t> pixels_;          // by patch
  std::vector<std::vector<Run>> masks_;  // ascending by end
};

}  // namespace pepeseg
