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

// The pixels of a view that another view shows, and the values of that view's map there.
struct TransferredMap {
  std::vector<uint8_t> known;   // [height, width] 1: the map's view shows what the pixel shows
  std::vector<uint8_t> values;  // [height, width] of the map; 0 where it is not known
};
// Returns what a map [height, width] of the view `from`, such as a mask, says about each pixel of
// `to`. A surface
// is the same in both if the depths agree within 3 %.
TransferredMap TransferMap(const ViewDepth& from, std::span<const uint8_t> map,
                           const ViewDepth& to);

}  // namespace pepeseg
