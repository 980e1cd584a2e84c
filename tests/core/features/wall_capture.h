#pragma once

#include <vector>

#include "core/features/near_views.h"
#include "core/scene/capture.h"

namespace pepeseg::testing {

// A rectangle on the wall, world units: [x0, x1) x [y0, y1).
struct WallPatch {
  double x0, y0, x1, y1;
};

// Views of a wall at z = 2 by cameras side by side. All of them see [-1, 1] x [-1, 1]; a pixel is
// 0.05 wide on the wall. patches: the rectangles that each view has as masks.
struct WallCapture {
  explicit WallCapture(const std::vector<std::vector<WallPatch>>& patches);
  WallCapture(const WallCapture&) = delete;
  WallCapture& operator=(const WallCapture&) = delete;

  // Returns the same scale for each mask, by view and mask.
  std::vector<std::vector<float>> EqualScales(float scale) const;
  // Returns the mask that a view would have of a rectangle.
  BinaryMask MaskOf(int view, const WallPatch& patch) const;

  Capture capture;
  Reprojection reprojection;
};

}  // namespace pepeseg::testing
