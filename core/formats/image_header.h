#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <span>

#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"

namespace pepeseg {

inline constexpr int64_t kMaxImagePixels = 64'000'000;  // limit of width * height

enum class ImageFormat { kJpeg, kPng, kWebp, kHeic };

// Returns ".jpg", ".png", ".webp" or ".heic".
const char* SuffixOf(ImageFormat format);

// Returns the content type of a file by its first 16 bytes, such as "image/jpeg", or
// "application/octet-stream" if it is not an image.
const char* ContentTypeOf(absl::string_view start);

// Format and size of an image, in stored pixels (for HEIC: as shown).
struct ImageHeader {
  ImageFormat format = ImageFormat::kJpeg;
  int width = 0;
  int height = 0;
};

// Returns format and size of an image file without decoding it. The format follows from its first
// bytes, never from its name. Also walks the segments to the end marker, to find files that are cut
// short: decoders fill the missing part with grey and report success. INVALID_ARGUMENT, naming
// `name`: the format is not JPEG, PNG, WebP or HEIC, the image exceeds kMaxImagePixels, a JPEG has
// over 100 scans, or the file is cut short or malformed.
absl::StatusOr<ImageHeader> ReadImageHeader(absl::string_view name, std::span<const uint8_t> bytes);

// Limits of ReadImageSize: bytes of one read, and reads of one file. They suffice for a JPEG whose
// frame header follows 200 segments (16 MiB) of EXIF, colour profile and previews.
inline constexpr size_t kHeaderReadBytes = 4096;
inline constexpr int kMaxHeaderReads = 256;

// Returns format and size from the header alone, in bounded time whatever the size of the file:
// reads its first bytes and, for a JPEG, the beginning of each segment up to the frame header. Does
// not notice a file that is cut short after its header. INVALID_ARGUMENT, naming `name`: as
// ReadImageHeader, or the header is not found within the limits above. NOT_FOUND: there is no such
// file. INTERNAL: it cannot be read.
absl::StatusOr<ImageHeader> ReadImageSize(const std::filesystem::path& path,
                                          absl::string_view name);

}  // namespace pepeseg
