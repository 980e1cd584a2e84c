#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "core/scene/capture.h"

namespace pepeseg {

// Encodes an image with 1 (grey), 3 (RGB) or 4 channels (RGBA) as a PNG file in memory.
// INVALID_ARGUMENT: the image is empty, has another number of channels, or its pixels do not fit
// its size.
absl::StatusOr<std::string> EncodePng(const Image& image);
// A grey image of 16 bits, for depth.
struct Grey16Image {
  int width = 0;
  int height = 0;
  std::vector<uint16_t> pixels;  // [height, width]
};
// Encodes it as a PNG of 16 bits. Errors as above.
absl::StatusOr<std::string> EncodePng(const Grey16Image& image);
// Encodes an image with 1 or 3 channels as a JPEG file in memory. `quality` is in [1, 100]. Errors
// as EncodePng.
absl::StatusOr<std::string> EncodeJpeg(const Image& image, int quality = 90);

}  // namespace pepeseg
