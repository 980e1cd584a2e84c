#pragma once

#include "core/scene/capture.h"

namespace pepeseg {

// Whether stage two learns from a view.
inline bool IsTrained(const View& view) { return !view.held_out && !view.masks.empty(); }

}  // namespace pepeseg
