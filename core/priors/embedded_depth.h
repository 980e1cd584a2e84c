#pragma once

#include <span>
#include <vector>

#include "core/scene/capture.h"

namespace pepeseg {

// Depth without any network: that of the points which structure from motion found, spread over each
// photograph up to where colour and texture change.
struct EmbeddedDepthOptions {
  int max_extent = 320;        // pixels: larger photographs are looked at in this size
  double smoothness = 0.2;     // weight of neighbouring pixels' difference against a point's 1
  double edge_strength = 0.1;  // over which a boundary lets little through, see BoundaryStrength
  int min_points = 16;         // a view that shows fewer has no depth
};

// Of each pixel of the view, z in scene units [height, width]; NaN where no point is near enough to
// say anything, and where the view is to be ignored. Empty: too few points are seen. The view must
// have a photograph. Points that others hide are left out as far as they can be told: those behind
// several nearer ones.
std::vector<float> EmbeddedDepth(const View& view, std::span<const ScenePoint> points,
                                 const EmbeddedDepthOptions& options = {});

}  // namespace pepeseg
