#pragma once

#include <cstdint>
#include <span>
#include <string>

namespace pepeseg::client::cli {

// Returns the bytes of a PNG file with an image [height, width, channels] of 8 bits: grey, or RGB
// with 3 channels. Returns "" if memory is short, or if a side is longer than a million pixels,
// which readers refuse.
std::string PngBytes(int width, int height, int channels, std::span<const uint8_t> pixels);

}  // namespace pepeseg::client::cli
