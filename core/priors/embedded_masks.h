#pragma once

#include <vector>

#include "core/scene/capture.h"

namespace pepeseg {

inline constexpr int kMaxEmbeddedMasks = 64;  // most masks of a view

struct EmbeddedMaskSet {
  MaskSet masks;  // the best first
  // [num_masks] in (0, 1]: the share of the border that is a boundary, times the mask's share of
  // the photograph to the power of 0.15.
  std::vector<float> quality;
};

// Computes masks without a network (METHOD.md section 6). The photograph is cut into small regions
// where colour, texture and depth change; the regions are merged, the most alike first. Merged
// regions with a clear border all around become masks: parts within objects within groups.
//
// Returns the best masks of the view, at most `max_masks`, without ignored pixels. The view must
// have a photograph; its depth prior is used where it has one.
EmbeddedMaskSet EmbeddedMasks(const View& view, int max_masks = kMaxEmbeddedMasks);

}  // namespace pepeseg
