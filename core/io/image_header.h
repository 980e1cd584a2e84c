#pragma once

#include <cstdint>
#include <span>

#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"

namespace pepeseg {

inline constexpr int64_t kMaxImagePixels = 64'000'000;

enum class ImageFormat { kJpeg, kPng, kWebp };

// ".jpg", ".png" or ".webp".
const char* SuffixOf(ImageFormat format);

struct ImageHeader {
  ImageFormat format = ImageFormat::kJpeg;
  int width = 0;
  int height = 0;
};

// What an image file says of itself, by its first bytes and never by its name, without decoding.
// Also walks the file's segments to its end marker, so that a file cut short is told from a whole
// one: decoders fill the missing part with grey and call it success. INVALID_ARGUMENT with `name`:
// another format than JPEG, PNG or WebP; over kMaxImagePixels; cut short; malformed.
absl::StatusOr<ImageHeader> ReadImageHeader(absl::string_view name, std::span<const uint8_t> bytes);

}  // namespace pepeseg
