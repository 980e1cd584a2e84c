#pragma once

#include <vector>

#include "core/scene/mask_set.h"

namespace pepeseg {

// A mask that a network for prompts gives, or can be given, and what its next answer builds on.
struct SoftMask {
  BinaryMask mask;  // [height, width] of the image
  double iou = 0;   // with what is meant, as the network estimates it
  std::vector<float>
      logits;  // of the network's own grid; positive inside; empty: of another origin
};

}  // namespace pepeseg
