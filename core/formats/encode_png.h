#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "core/scene/capture.h"

namespace pepeseg {

// A PNG or JPEG file in memory, of an image with 1 (grey), 3 (RGB) or, as a PNG, 4 channels (RGBA).
// INVALID_ARGUMENT: an empty image, or pixels that do not fit its size.
absl::StatusOr<std::string> EncodePng(const Image& image);
// A grey PNG of 16 bits.
struct Grey16Image {
  int width = 0;
  int height = 0;
  std::vector<uint16_t> pixels;  // [height, width]
};
absl::StatusOr<std::string> EncodePng(const Grey16Image& image);
// `quality`: 1..100.
absl::StatusOr<std::string> EncodeJpeg(const Image& image, int quality = 90);

}  // namespace pepeseg
