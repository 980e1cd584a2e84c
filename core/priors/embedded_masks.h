#pragma once

#include <vector>

#include "core/scene/capture.h"

namespace pepeseg {

// Masks without a network (METHOD.md section 6). A photograph is cut into small regions where
// colour, texture and depth change; the regions are merged, the most alike first. Merged regions
// with a clear border all around become masks: parts within objects within groups.
struct EmbeddedMaskOptions {
  int max_extent = 512;          // pixels; longer side at which a larger photograph is processed
  double min_area = 0.0008;      // smallest mask, as a share of the photograph
  double max_area = 0.7;         // largest mask, as a share of the photograph
  double max_open_border = 0.5;  // largest share of a mask's border without a boundary
  int max_masks = 64;            // most masks of a view; the best are kept
};

struct EmbeddedMaskSet {
  MaskSet masks;  // the best first
  // [num_masks] in (0, 1]: the share of the border that is a boundary, times the mask's share of
  // the photograph to the power of 0.15.
  std::vector<float> quality;
};

// Returns the masks of one view, without ignored pixels. The view must have a photograph; its depth
// prior is used where it has one.
EmbeddedMaskSet EmbeddedMasks(const View& view, const EmbeddedMaskOptions& options = {});

}  // namespace pepeseg
