#pragma once

#include <vector>

#include "core/render/renderer.h"
#include "core/scene/capture.h"

namespace pepeseg {

// Returns the confidence of each Gaussian's feature, [num_gaussians] in [0.005, 1] (METHOD.md
// section 3, "Confidence"; not in the paper). It suppresses floaters: a Gaussian that only one or
// two cameras see has a feature that fits those views alone, and occludes the scene in all others.
//
// Up to 64 of the training views with masks are looked at, spread evenly. The confidence is
// (views that show the Gaussian / required views)^2, at most 1, where `min_confident_views` views
// are required, but at least a sixth of the views looked at, and at most all of them.
std::vector<float> FeatureConfidence(const Capture& capture, Renderer& scene,
                                     int min_confident_views);

}  // namespace pepeseg
