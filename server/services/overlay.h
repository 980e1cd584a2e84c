#pragma once

#include "core/scene/capture.h"
#include "core/scene/mask_set.h"

namespace pepeseg {

// Tints an RGB image where the mask, of its size, is, and draws the mask's border.
void DrawOverlay(const BinaryMask& mask, Image& image);

}  // namespace pepeseg
