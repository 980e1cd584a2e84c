#pragma once

#include "core/scene/capture.h"

namespace pepeseg {

// Rotates and mirrors an image by an EXIF orientation in [1, 8], so that it is upright. Other
// values leave it unchanged.
Image Upright(Image image, int orientation);

// Shrinks an image by averaging, so that its longer side has `max_side` pixels. Returns it
// unchanged if it is not larger, or if `max_side` is 0.
Image ShrunkTo(Image image, int max_side);

}  // namespace pepeseg
