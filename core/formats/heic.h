#pragma once

#include <cstdint>
#include <span>
#include <string>

#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"
#include "core/scene/capture.h"

namespace pepeseg {

// A HEIC photograph, decoded by libheif: for processes in a sandbox only.
struct HeicPhoto {
  Image image;       // RGB, 8 bit; turned and cropped as the file says
  std::string exif;  // TIFF structure of its EXIF data; empty: it has none
};

// INVALID_ARGUMENT with `name`: what ReadImageHeader refuses, another format, and what does not
// decode.
absl::StatusOr<HeicPhoto> DecodeHeic(std::span<const uint8_t> bytes, absl::string_view name);

// The photograph as a JPEG of quality 95 with its EXIF data, in which the orientation is 1: its
// pixels are upright. Errors as DecodeHeic.
absl::StatusOr<std::string> HeicToJpeg(std::span<const uint8_t> bytes, absl::string_view name);

}  // namespace pepeseg
