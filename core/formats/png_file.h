#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"
#include "core/formats/image_header.h"

namespace pepeseg {

// Pixels of a PNG, row-major [height, width, channels].
struct PngPixels {
  int channels = 0;   // 1 (grey), 3 (RGB) or 4 (RGBA)
  int bit_depth = 8;  // 8 or 16
  // The samples; those of 16 bits in the machine's order of bytes.
  std::vector<uint8_t> bytes;
};

// The form that a PNG is decoded to. Palettes become colours, fewer than 8 bits become 8. Alpha is
// kept with colours, or with grey values as RGBA; a transparent colour becomes alpha, a transparent
// grey value does not.
enum class PngForm {
  kStored,      // grey values stay one channel, 16 bits stay 16
  kPhotograph,  // grey values become RGB, and 16 bits their upper 8, unless there is alpha
};

// Decodes a PNG whose header ReadImageHeader has returned. INVALID_ARGUMENT, naming `name`: it does
// not decode.
absl::StatusOr<PngPixels> DecodePng(std::span<const uint8_t> bytes, const ImageHeader& header,
                                    absl::string_view name, PngForm form);

// Encodes valid pixels as a PNG, for speed rather than size.
absl::StatusOr<std::string> PngBytes(int width, int height, int channels, int bit_depth,
                                     const uint8_t* samples);

}  // namespace pepeseg
