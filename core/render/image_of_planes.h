#pragma once

#include <span>

#include "core/scene/capture.h"

namespace pepeseg {

// Returns colours in planes [3, height, width], as Renderer::ColorPlanes has them, as an RGB image.
// Values outside [0, 1] are clamped.
Image ImageOfPlanes(int width, int height, std::span<const float> planes);

}  // namespace pepeseg
