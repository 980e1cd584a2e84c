#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <span>

#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"

namespace pepeseg {

inline constexpr int64_t kMaxImagePixels = 64'000'000;

enum class ImageFormat { kJpeg, kPng, kWebp, kHeic };

// ".jpg", ".png", ".webp" or ".heic".
const char* SuffixOf(ImageFormat format);

struct ImageHeader {
  ImageFormat format = ImageFormat::kJpeg;
  int width = 0;
  int height = 0;
};

// What an image file says of itself, by its first bytes and never by its name, without decoding.
// Also walks the file's segments to its end marker, so that a file cut short is told from a whole
// one: decoders fill the missing part with grey and call it success. INVALID_ARGUMENT with `name`:
// another format than JPEG, PNG, WebP or HEIC; over kMaxImagePixels; cut short; malformed.
absl::StatusOr<ImageHeader> ReadImageHeader(absl::string_view name, std::span<const uint8_t> bytes);

// Bounds of ReadImageSize: bytes of one read, and reads of one file. They reach the frame header of
// a JPEG behind 200 segments (16 MiB) of EXIF, colour profile and previews.
inline constexpr size_t kHeaderReadBytes = 4096;
inline constexpr int kMaxHeaderReads = 256;

// Returns format and size from the header alone, whatever the size of the file: reads its first
// bytes and, of a JPEG, the beginning of each segment up to the frame header. Does not find that a
// file is cut short behind its header. INVALID_ARGUMENT with `name` as ReadImageHeader, and where
// the header is not found within the bounds above; NOT_FOUND: there is no such file; INTERNAL: it
// cannot be read.
absl::StatusOr<ImageHeader> ReadImageSize(const std::filesystem::path& path,
                                          absl::string_view name);

}  // namespace pepeseg
