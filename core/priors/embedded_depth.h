#pragma once

#include <span>
#include <vector>

#include "core/scene/capture.h"

namespace pepeseg {

// Computes depth without a network: the depths of structure-from-motion points, spread over the
// photograph up to where colour and texture change (METHOD.md section 6).
//
// Returns the depth z of each pixel of the view in scene units, [height, width]; NaN where no point
// is near enough and where the view's ignore mask is set. Returns an empty vector when too few
// points are visible. The view must have a photograph. Points that several much nearer ones
// surround are taken for hidden and left out.
std::vector<float> EmbeddedDepth(const View& view, std::span<const ScenePoint> points);

}  // namespace pepeseg
