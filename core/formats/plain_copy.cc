#include "core/formats/plain_copy.h"

#include <string_view>
#include <utility>

#include "core/base/status_macros.h"
#include "core/formats/exif.h"
#include "core/formats/image_header.h"
#include "core/formats/images.h"

namespace pepeseg {
namespace {

constexpr int kJpegQuality = 95;

// Returns true if a PNG has a chunk of this type in front of its pixels. Chunks have a big-endian
// length, a type, the content and a checksum.
bool HasChunk(std::span<const uint8_t> png, std::string_view type) {
  constexpr size_t kFirst = 8, kHeader = 8, kChecksum = 4;
  for (size_t at = kFirst; at + kHeader <= png.size();) {
    const std::string_view found(reinterpret_cast<const char*>(png.data()) + at + 4, 4);
    if (found == type) return true;
    if (found == "IDAT") return false;
    size_t length = 0;
    for (size_t i = 0; i < 4; ++i) length = length << 8 | png[at + i];
    at += kHeader + length + kChecksum;
  }
  return false;
}

// Returns true for a PNG of 8 bits, grey or RGB, without a transparent colour.
bool IsPlainPng(std::span<const uint8_t> bytes) {
  constexpr size_t kBitDepth = 24, kColourType = 25;  // positions in the file, PNG 11.2.2
  constexpr uint8_t kGrey = 0, kColour = 2;
  return bytes.size() > kColourType && bytes[kBitDepth] == 8 &&
         (bytes[kColourType] == kGrey || bytes[kColourType] == kColour) && !HasChunk(bytes, "tRNS");
}

}  // namespace

absl::StatusOr<std::string> PlainCopy(std::span<const uint8_t> bytes, absl::string_view name,
                                      const PlainCopyOptions& options) {
  ASSIGN_OR_RETURN(const ImageHeader header, ReadImageHeader(name, bytes));
  const int orientation = options.upright ? ReadExifOrientation(bytes) : 1;
  const bool plain = header.format == ImageFormat::kJpeg ||
                     (header.format == ImageFormat::kPng && IsPlainPng(bytes)) ||
                     (header.format == ImageFormat::kWebp && options.webp);
  if (plain && orientation == 1) return std::string();
  ASSIGN_OR_RETURN(Image image, DecodePhoto(bytes, name));
  image = Upright(std::move(image), orientation);
  if (header.format != ImageFormat::kJpeg) return EncodePng(image);
  ASSIGN_OR_RETURN(std::string jpeg, EncodeJpeg(image, kJpegQuality));
  return WithUprightExif(std::move(jpeg), ReadExifData(bytes));
}

}  // namespace pepeseg
