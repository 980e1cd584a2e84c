#pragma once

#include <cstdint>
#include <vector>

#include "core/features/frozen_scene.h"
#include "core/scene/capture.h"

namespace pepeseg {

// Pixels of each training view that are background: no mask covers them, and hardly any covers what
// they show where other views see it. An uncovered pixel alone says little, because a mask may just
// be missing in its view; the Gaussians that it shows tell how often masks covered them. The pixels
// are y * width + x on a grid of the view, none of them ignored. [views]; empty for held-out views
// and views without masks.
std::vector<std::vector<int32_t>> BackgroundPixels(const Capture& capture, FrozenScene& scene);

}  // namespace pepeseg
