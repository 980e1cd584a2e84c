#pragma once

#include <cstdint>
#include <span>
#include <string>

#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"
#include "core/scene/capture.h"

namespace pepeseg {

// A decoded HEIC photograph. libheif decodes it, so only processes in a sandbox may call the
// functions below.
struct HeicPhoto {
  Image image;       // RGB, 8 bit, after the rotation and cropping that the file asks for
  std::string exif;  // TIFF structure of the EXIF data; empty: none, or too large for a JPEG
};

// Decodes a photograph. INVALID_ARGUMENT, naming `name`: ReadImageHeader refuses the file, it has
// another format, or it does not decode.
absl::StatusOr<HeicPhoto> DecodeHeic(std::span<const uint8_t> bytes, absl::string_view name);

// Converts the photograph to a JPEG of quality 95. Keeps its EXIF data, but with orientation 1,
// because the decoded pixels are upright. Errors as DecodeHeic.
absl::StatusOr<std::string> HeicToJpeg(std::span<const uint8_t> bytes, absl::string_view name);

}  // namespace pepeseg
