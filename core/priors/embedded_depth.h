#pragma once

#include <span>
#include <vector>

#include "core/scene/capture.h"

namespace pepeseg {

// Depth without a network: the depths of structure-from-motion points, spread over each photograph
// up to where colour and texture change (METHOD.md section 6).
struct EmbeddedDepthOptions {
  int max_extent = 320;     // pixels; longer side at which a larger photograph is processed
  double smoothness = 0.2;  // weight of the difference of two neighbours; a point has 1
  // Boundary strength at which that weight has fallen to 1/e, see BoundaryStrength. Over 0.
  double edge_strength = 0.1;
  int min_points = 16;  // fewest pixels with a point; with fewer the view has no depth
};

// Returns the depth z of each pixel of the view in scene units, [height, width]; NaN where no point
// is near enough and where the view's ignore mask is set. Returns an empty vector when too few
// points are visible. The view must have a photograph. Points that several much nearer ones
// surround are taken for hidden and left out.
std::vector<float> EmbeddedDepth(const View& view, std::span<const ScenePoint> points,
                                 const EmbeddedDepthOptions& options = {});

}  // namespace pepeseg
