#pragma once

#include "core/scene/capture.h"
#include "core/scene/gaussians.h"

namespace pepeseg::testing {

// Returns a nearly opaque round Gaussian of standard deviation `size` at each point of a capture:
// geometry that is good enough to segment, without stage one.
Gaussians PointGaussians(const Capture& capture, float size);

}  // namespace pepeseg::testing
