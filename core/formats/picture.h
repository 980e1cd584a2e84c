#pragma once

#include "core/scene/capture.h"

// Changes to an image that is shown to people.
namespace pepeseg {

// The image as EXIF's orientation 1 to 8 says that it is looked at; unchanged by other values.
Image Upright(Image image, int orientation);

// The image with its longer side shrunk to `max_side` pixels by averaging; unchanged when it is not
// larger, or when `max_side` is 0.
Image ShrunkTo(Image image, int max_side);

}  // namespace pepeseg
