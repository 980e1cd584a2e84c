#pragma once

#include "core/scene/capture.h"

namespace pepeseg {

// The photograph with its longer side at most `max_extent` pixels, area-averaged.
Image ShrunkPhoto(const Image& photo, int max_extent);

}  // namespace pepeseg
