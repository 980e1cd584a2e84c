#pragma once

#include <cstdint>
#include <span>

namespace pepeseg {

// Writes x, y, width and height of the smallest box around the pixels of a mask that are 1, of
// `width` pixels a row; zeros where none is.
void FindBox(std::span<const uint8_t> mask, int width, int (&box)[4]);

}  // namespace pepeseg
