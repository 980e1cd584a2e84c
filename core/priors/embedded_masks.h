#pragma once

#include "core/scene/capture.h"

namespace pepeseg {

// Masks without any network: where colour, texture and depth change, a photograph is cut into small
// regions, which are merged in the order of their likeness; those with a clear border all around
// are masks, parts within objects within groups.
struct EmbeddedMaskOptions {
  int max_extent = 512;      // pixels: larger photographs are looked at in this size
  double min_area = 0.0008;  // of a mask, as a share of the photograph
  double max_area = 0.7;
  int max_masks = 64;  // a view, the best ones
};

// The masks of one view, the best first, without the pixels that are to be ignored.
MaskSet EmbeddedMasks(const View& view, const EmbeddedMaskOptions& options = {});

}  // namespace pepeseg
