#include "core/io/image_header.h"

#include <algorithm>
#include <array>

#include "absl/strings/str_cat.h"
#include "core/status_macros.h"

namespace pepeseg {
namespace {

using Bytes = std::span<const uint8_t>;

constexpr std::array<uint8_t, 8> kPngMagic = {0x89, 'P', 'N', 'G', '\r', '\n', 0x1A, '\n'};
constexpr std::array<uint8_t, 3> kJpegMagic = {0xFF, 0xD8, 0xFF};

bool StartsWith(Bytes bytes, Bytes magic) {
  return bytes.size() >= magic.size() && std::equal(magic.begin(), magic.end(), bytes.begin());
}

bool HasTag(Bytes bytes, size_t at, absl::string_view tag) {
  return bytes.size() >= at + tag.size() &&
         std::equal(tag.begin(), tag.end(), bytes.begin() + static_cast<ptrdiff_t>(at),
                    [](char a, uint8_t b) { return static_cast<uint8_t>(a) == b; });
}

uint32_t BigEndian(Bytes bytes, size_t at, int num_bytes) {
  uint32_t value = 0;
  for (int i = 0; i < num_bytes; ++i) value = value << 8 | bytes[at + i];
  return value;
}

uint32_t LittleEndian(Bytes bytes, size_t at, int num_bytes) {
  uint32_t value = 0;
  for (int i = num_bytes - 1; i >= 0; --i) value = value << 8 | bytes[at + i];
  return value;
}

absl::Status CutShort(absl::string_view format) {
  return absl::InvalidArgumentError(absl::StrCat("the ", format, " file is cut short"));
}

absl::Status Malformed(absl::string_view format, absl::string_view why) {
  return absl::InvalidArgumentError(absl::StrCat("malformed ", format, " file: ", why));
}

struct Size {
  uint64_t width = 0;
  uint64_t height = 0;
};

// ISO/IEC 10918-1 annex B: markers 0xFF xx; all but a few carry a big-endian length that counts
// itself. Behind SOS come entropy-coded bytes, in which 0xFF is followed by 0 or a restart marker.
constexpr uint8_t kSof0 = 0xC0, kDht = 0xC4, kJpg = 0xC8, kDac = 0xCC, kSof15 = 0xCF;
constexpr uint8_t kRst0 = 0xD0, kRst7 = 0xD7, kEoi = 0xD9, kSos = 0xDA, kTem = 0x01;

bool IsFrameHeader(uint8_t marker) {
  return marker >= kSof0 && marker <= kSof15 && marker != kDht && marker != kJpg && marker != kDac;
}

// The offset behind the entropy-coded bytes that start at `at`: of the next marker, or the end.
size_t SkipScan(Bytes bytes, size_t at) {
  for (; at + 1 < bytes.size(); ++at) {
    if (bytes[at] != 0xFF) continue;
    const uint8_t next = bytes[at + 1];
    const bool restart = next >= kRst0 && next <= kRst7;
    if (next != 0 && next != 0xFF && !restart) return at;
  }
  return bytes.size();
}

absl::StatusOr<Size> JpegSize(Bytes bytes) {
  Size size;
  bool scanned = false;
  size_t at = 2;
  while (at + 2 <= bytes.size()) {
    const uint8_t marker = bytes[at + 1];
    // Fill bytes, and what lies between segments without being one: decoders pass over it too.
    if (bytes[at] != 0xFF || marker == 0xFF || marker == 0) {
      ++at;
      continue;
    }
    at += 2;
    if (marker == kEoi) {
      if (size.width == 0 || !scanned) return Malformed("JPEG", "it ends without a picture");
      return size;
    }
    if (marker == kTem || (marker >= kRst0 && marker <= kRst7)) continue;
    if (at + 2 > bytes.size()) break;
    const size_t length = BigEndian(bytes, at, 2);
    if (length < 2) return Malformed("JPEG", absl::StrCat("segment of no length at byte ", at));
    if (at + length > bytes.size()) break;
    if (IsFrameHeader(marker) && size.width == 0) {
      if (length < 8) return Malformed("JPEG", "short frame header");
      size = {BigEndian(bytes, at + 5, 2), BigEndian(bytes, at + 3, 2)};
      if (size.width == 0 || size.height == 0) return Malformed("JPEG", "the size is 0");
    }
    at += length;
    if (marker == kSos) {
      at = SkipScan(bytes, at);
      scanned = true;
    }
  }
  return CutShort("JPEG");
}

// PNG: chunks of big-endian length, type, data and CRC, from IHDR to IEND.
absl::StatusOr<Size> PngSize(Bytes bytes) {
  constexpr size_t kAround = 12;  // length, type and CRC of a chunk
  size_t at = kPngMagic.size();
  if (bytes.size() < at + kAround + 13) return CutShort("PNG");
  if (!HasTag(bytes, at + 4, "IHDR") || BigEndian(bytes, at, 4) != 13) {
    return Malformed("PNG", "its first chunk is not the header");
  }
  const Size size = {BigEndian(bytes, at + 8, 4), BigEndian(bytes, at + 12, 4)};
  while (bytes.size() - at >= kAround) {
    const uint64_t length = BigEndian(bytes, at, 4);
    if (length > bytes.size() - at - kAround) break;
    if (HasTag(bytes, at + 4, "IEND")) return size;
    at += kAround + length;
  }
  return CutShort("PNG");
}

// WebP: a RIFF container whose first chunk is VP8 (lossy), VP8L (lossless) or VP8X (extended).
absl::StatusOr<Size> WebpSize(Bytes bytes) {
  constexpr size_t kSmallest = 30;
  if (bytes.size() < kSmallest) return CutShort("WebP");
  if (uint64_t{LittleEndian(bytes, 4, 4)} + 8 > bytes.size()) return CutShort("WebP");
  if (HasTag(bytes, 12, "VP8X")) {
    return Size{LittleEndian(bytes, 24, 3) + 1, LittleEndian(bytes, 27, 3) + 1};
  }
  if (HasTag(bytes, 12, "VP8L")) {
    const uint32_t packed = LittleEndian(bytes, 21, 4);
    return Size{(packed & 0x3FFF) + 1, (packed >> 14 & 0x3FFF) + 1};
  }
  if (HasTag(bytes, 12, "VP8 ")) {
    return Size{LittleEndian(bytes, 26, 2) & 0x3FFF, LittleEndian(bytes, 28, 2) & 0x3FFF};
  }
  return Malformed("WebP", "its first chunk is not a picture");
}

absl::StatusOr<Size> SizeOf(ImageFormat format, Bytes bytes) {
  if (format == ImageFormat::kJpeg) return JpegSize(bytes);
  if (format == ImageFormat::kPng) return PngSize(bytes);
  return WebpSize(bytes);
}

absl::StatusOr<ImageFormat> FormatOf(Bytes bytes) {
  if (StartsWith(bytes, kJpegMagic)) return ImageFormat::kJpeg;
  if (StartsWith(bytes, kPngMagic)) return ImageFormat::kPng;
  if (HasTag(bytes, 0, "RIFF") && HasTag(bytes, 8, "WEBP")) return ImageFormat::kWebp;
  return absl::InvalidArgumentError("not a JPEG, PNG or WebP image");
}

absl::StatusOr<ImageHeader> Read(Bytes bytes) {
  ASSIGN_OR_RETURN(const ImageFormat format, FormatOf(bytes));
  ASSIGN_OR_RETURN(const Size size, SizeOf(format, bytes));
  if (size.width == 0 || size.height == 0) return absl::InvalidArgumentError("an empty image");
  if (size.width * size.height > static_cast<uint64_t>(kMaxImagePixels)) {
    return absl::InvalidArgumentError(
        absl::StrCat(size.width, "x", size.height, " pixels, the limit is ", kMaxImagePixels));
  }
  return ImageHeader{format, static_cast<int>(size.width), static_cast<int>(size.height)};
}

}  // namespace

const char* SuffixOf(ImageFormat format) {
  switch (format) {
    case ImageFormat::kJpeg:
      return ".jpg";
    case ImageFormat::kPng:
      return ".png";
    case ImageFormat::kWebp:
      return ".webp";
  }
  return "";
}

absl::StatusOr<ImageHeader> ReadImageHeader(absl::string_view name,
                                            std::span<const uint8_t> bytes) {
  absl::StatusOr<ImageHeader> header = Read(bytes);
  if (header.ok()) return header;
  return absl::InvalidArgumentError(absl::StrCat(name, ": ", header.status().message()));
}

}  // namespace pepeseg
