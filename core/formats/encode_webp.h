#pragma once

#include <cstdint>
#include <span>
#include <string>

namespace pepeseg {

// Encodes RGBA pixels, row-major [height, width, 4], as a lossless WebP in memory, which keeps all
// bytes, also the colours of pixels with alpha 0. Sides are 1 to 16383.
std::string EncodeLosslessWebp(std::span<const uint8_t> pixels, int width, int height);

}  // namespace pepeseg
