#pragma once

#include <vector>

#include "core/scene/capture.h"

namespace pepeseg {

// Masks without any network: where colour, texture and depth change, a photograph is cut into small
// regions, which are merged in the order of their likeness; those with a clear border all around
// are masks, parts within objects within groups.
struct EmbeddedMaskOptions {
  int max_extent = 512;      // pixels: larger photographs are looked at in this size
  double min_area = 0.0008;  // of a mask, as a share of the photograph
  double max_area = 0.7;
  double max_open_border = 0.5;  // share of a mask's border at which nothing ends
  int max_masks = 64;            // a view, the best ones
};

struct EmbeddedMaskSet {
  MaskSet masks;  // the best first
  // [num_masks] in (0, 1]: the share of the border at which something ends, times the mask's share
  // of the photograph to the power of 0.15.
  std::vector<float> quality;
};
// The masks of one view, without the pixels that are to be ignored.
EmbeddedMaskSet EmbeddedMasks(const View& view, const EmbeddedMaskOptions& options = {});

}  // namespace pepeseg
