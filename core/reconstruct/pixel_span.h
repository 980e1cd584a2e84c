#pragma once

#include <vector>

#include "core/scene/capture.h"

namespace pepeseg {

// Returns the width of a pixel at the depth of the scene, in scene units: the median over the views
// of (median depth of the points in front of the view) / (focal length in pixels). At most 256
// views and 1,024 points are taken, evenly spaced. Infinite where no view has a point in front of
// it. It caps the learning rate of the means (METHOD.md section 1.1).
double PixelSpan(const Capture& capture, const std::vector<ScenePoint>& points);

}  // namespace pepeseg
