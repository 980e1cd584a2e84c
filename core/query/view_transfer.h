#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "core/scene/model.h"

namespace pepeseg {

// A view and the depth along its optical axis, scene units, [height, width]; 0 where nothing is
// rendered.
struct ViewDepth {
  ModelView view;
  std::vector<float> depth;
};

// The pixels of a view that another view shows, and those of them in that view's mask.
struct TransferredMask {
  std::vector<uint8_t> known;   // [height, width] 1: the mask's view shows what the pixel shows
  std::vector<uint8_t> inside;  // [height, width] 1: and the mask has it
};
// Returns what a mask [height, width] of the view `from` says about each pixel of `to`. A surface
// is the same in both if the depths agree within 3 %.
TransferredMask TransferMask(const ViewDepth& from, std::span<const uint8_t> mask,
                             const ViewDepth& to);

}  // namespace pepeseg
