#pragma once

#include <cstdint>

#include "tests/bench/capture_pack.h"

namespace pepeseg {

// How much of a capture a run is given: for tables of robustness.
struct CaptureShare {
  int every_view = 1;        // every n-th of the training views
  double dropped_masks = 0;  // share of the masks, drawn for each view alone
  bool without_depth = false;
};
void Reduce(const CaptureShare& share, CapturePack& pack);

}  // namespace pepeseg
