#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "core/query/prompt.h"

namespace pepeseg {

// The pixels of its view, y * width + x ascending, that a prompt points at: those within 2 pixels
// of a positive point, those whose centre is in the box, those of the mask. Evenly thinned out to
// at most `max_count`, > 0.
std::vector<int32_t> PromptedPixels(const Prompt& prompt, size_t max_count);

}  // namespace pepeseg
