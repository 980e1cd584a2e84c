#pragma once

#include <vector>

#include "core/scene/capture.h"

namespace pepeseg {

// What a pixel of the training views spans at the depth of the points in front of them, scene
// units: the median over (at most some hundred) views of their points' median depth over the focal
// length. Infinite where no view has a point in front of it.
double PixelSpan(const Capture& capture, const std::vector<ScenePoint>& points);

}  // namespace pepeseg
