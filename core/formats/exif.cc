#include "core/formats/exif.h"

#include <algorithm>
#include <iterator>
#include <string_view>

namespace pepeseg {
namespace {

// EXIF data is a TIFF structure: directories of 12-byte entries (tag, type, count, value). The tags
// below are in the main directory or in the one that kExifDirectory points to (EXIF 2.3).
constexpr uint32_t kMaker = 0x010f;
constexpr uint32_t kModel = 0x0110;
constexpr uint32_t kOrientation = 0x0112;
constexpr uint32_t kExifDirectory = 0x8769;
constexpr uint32_t kFocalLength = 0x920a;
constexpr uint32_t kFocalLength35Mm = 0xa405;
constexpr uint32_t kEntryBytes = 12;
constexpr size_t kMaxText = 64;

// Reads numbers and text from a TIFF structure, in the byte order that it declares. A number beyond
// its end is 0, so that malformed offsets need no other check.
class Tiff {
 public:
  explicit Tiff(std::span<const uint8_t> bytes) : bytes_(bytes) {
    big_endian_ = bytes.size() > 1 && bytes[0] == 'M' && bytes[1] == 'M';
  }

  uint32_t Number(uint32_t offset, uint32_t num_bytes) const {
    if (offset > bytes_.size() || bytes_.size() - offset < num_bytes) return 0;
    uint32_t value = 0;
    for (uint32_t i = 0; i < num_bytes; ++i) {
      const uint32_t byte = bytes_[offset + i];
      value |= byte << (8 * (big_endian_ ? num_bytes - 1 - i : i));
    }
    return value;
  }

  // Returns the text at `offset`, at most `length` bytes and up to a NUL byte.
  std::string Text(uint32_t offset, uint32_t length) const {
    if (offset > bytes_.size()) return "";
    const auto rest = bytes_.subspan(offset);
    const auto text = rest.first(std::min({rest.size(), size_t{length}, kMaxText}));
    return {text.begin(), std::find(text.begin(), text.end(), 0)};
  }

 private:
  std::span<const uint8_t> bytes_;
  bool big_endian_ = false;
};

// Sets the fields of `camera` from the entries of one directory.
void ReadDirectory(const Tiff& tiff, uint32_t offset, ExifCamera& camera) {
  // At most 65,535 entries, read past the end as zeros: a hostile count costs little.
  const uint32_t count = tiff.Number(offset, 2);
  for (uint32_t i = 0; i < count; ++i) {
    const uint32_t entry = offset + 2 + i * kEntryBytes;
    const uint32_t length = tiff.Number(entry + 4, 4);
    const uint32_t value = tiff.Number(entry + 8, 4);
    // A value of up to four bytes is in the entry itself; a longer one is at the offset given
    // there.
    const uint32_t text = length > 4 ? value : entry + 8;
    switch (tiff.Number(entry, 2)) {
      case kMaker:
        camera.maker = tiff.Text(text, length);
        break;
      case kModel:
        camera.model = tiff.Text(text, length);
        break;
      case kFocalLength:
        // A rational number: two 32-bit integers at the offset.
        if (const uint32_t below = tiff.Number(value + 4, 4); below > 0) {
          camera.focal_length = static_cast<double>(tiff.Number(value, 4)) / below;
        }
        break;
      case kFocalLength35Mm:
        camera.focal_length_35_mm = static_cast<int>(tiff.Number(entry + 8, 2));
        break;
      default:
        break;
    }
  }
}

// Returns the offset of the main directory's first entry with `tag`, or 0 if it has none.
uint32_t FindEntry(const Tiff& tiff, uint32_t tag) {
  const uint32_t main = tiff.Number(4, 4);
  const uint32_t count = main == 0 ? 0 : tiff.Number(main, 2);
  for (uint32_t i = 0; i < count; ++i) {
    const uint32_t entry = main + 2 + i * kEntryBytes;
    if (tiff.Number(entry, 2) == tag) return entry;
  }
  return 0;
}

ExifCamera ReadTiff(std::span<const uint8_t> bytes) {
  const Tiff tiff(bytes);
  ExifCamera camera;
  const uint32_t main = tiff.Number(4, 4);
  if (main == 0) return camera;
  ReadDirectory(tiff, main, camera);
  const uint32_t entry = FindEntry(tiff, kExifDirectory);
  const uint32_t exif = entry == 0 ? 0 : tiff.Number(entry + 8, 4);
  // Focal lengths are in the second directory, maker and model in the main one.
  if (exif != 0) ReadDirectory(tiff, exif, camera);
  return camera;
}

constexpr uint8_t kMark[] = {'E', 'x', 'i', 'f', 0, 0};

bool HasMark(std::span<const uint8_t> bytes) {
  return bytes.size() > sizeof(kMark) &&
         std::equal(std::begin(kMark), std::end(kMark), bytes.begin());
}

std::span<const uint8_t> FindInJpeg(std::span<const uint8_t> bytes) {
  constexpr uint8_t kApp1 = 0xe1, kStartOfScan = 0xda;
  // Segments of 0xff, a marker, and a big-endian length that includes itself. EXIF precedes the
  // scan.
  for (size_t at = 2; at + 4 <= bytes.size() && bytes[at] == 0xff;) {
    const uint8_t marker = bytes[at + 1];
    const size_t length = size_t{bytes[at + 2]} << 8 | bytes[at + 3];
    if (marker == kStartOfScan || length < 2 || bytes.size() - at - 2 < length) return {};
    const auto segment = bytes.subspan(at + 4, length - 2);
    if (marker == kApp1 && HasMark(segment)) return segment.subspan(sizeof(kMark));
    at += 2 + length;
  }
  return {};
}

bool HasText(std::span<const uint8_t> bytes, size_t at, std::string_view text) {
  return bytes.size() >= at + text.size() &&
         std::equal(text.begin(), text.end(), bytes.begin() + static_cast<ptrdiff_t>(at),
                    [](char a, uint8_t b) { return static_cast<uint8_t>(a) == b; });
}

// Returns a number of four bytes, which must exist.
size_t Word(std::span<const uint8_t> bytes, size_t at, bool big_endian) {
  size_t value = 0;
  for (size_t i = 0; i < 4; ++i) value |= size_t{bytes[at + (big_endian ? 3 - i : i)]} << (8 * i);
  return value;
}

// PNG: chunks of a big-endian length, a type, the content and a checksum.
std::span<const uint8_t> FindInPng(std::span<const uint8_t> bytes) {
  constexpr size_t kFirst = 8, kHeader = 8, kChecksum = 4;
  for (size_t at = kFirst; at + kHeader + kChecksum <= bytes.size();) {
    const size_t length = Word(bytes, at, true);
    if (bytes.size() - at - kHeader - kChecksum < length) return {};
    if (HasText(bytes, at + 4, "eXIf")) return bytes.subspan(at + kHeader, length);
    at += kHeader + length + kChecksum;
  }
  return {};
}

// WebP: RIFF chunks of a type, a little-endian length and the content, padded to an even length.
std::span<const uint8_t> FindInWebp(std::span<const uint8_t> bytes) {
  constexpr size_t kFirst = 12, kHeader = 8;
  for (size_t at = kFirst; at + kHeader <= bytes.size();) {
    const size_t length = Word(bytes, at + 4, false);
    if (bytes.size() - at - kHeader < length) return {};
    const auto content = bytes.subspan(at + kHeader, length);
    // Some writers keep the mark of JPEG's segment.
    if (HasText(bytes, at, "EXIF")) {
      return HasMark(content) ? content.subspan(sizeof(kMark)) : content;
    }
    at += kHeader + length + length % 2;
  }
  return {};
}

// Returns the TIFF structure of the EXIF data of a JPEG, PNG or WebP, or nothing if it has none.
std::span<const uint8_t> FindTiff(std::span<const uint8_t> bytes) {
  if (HasText(bytes, 0, "\xff\xd8")) return FindInJpeg(bytes);
  if (HasText(bytes, 0, "\x89PNG\r\n\x1a\n")) return FindInPng(bytes);
  if (HasText(bytes, 0, "RIFF") && HasText(bytes, 8, "WEBP")) return FindInWebp(bytes);
  return {};
}

// Overwrites the orientation with 1. It is a 16-bit number, so it is in its entry.
void SetUpright(std::string& bytes) {
  const Tiff tiff({reinterpret_cast<const uint8_t*>(bytes.data()), bytes.size()});
  const size_t entry = FindEntry(tiff, kOrientation);
  if (entry == 0 || entry + kEntryBytes > bytes.size()) return;
  const bool big_endian = bytes[0] == 'M';
  bytes[entry + 8] = big_endian ? 0 : 1;
  bytes[entry + 9] = big_endian ? 1 : 0;
}

}  // namespace

ExifCamera ReadExifCamera(std::span<const uint8_t> bytes) { return ReadTiff(FindTiff(bytes)); }

int ReadExifOrientation(std::span<const uint8_t> bytes) {
  const Tiff tiff(FindTiff(bytes));
  const uint32_t entry = FindEntry(tiff, kOrientation);
  const uint32_t orientation = entry == 0 ? 1 : tiff.Number(entry + 8, 2);
  return orientation >= 1 && orientation <= 8 ? static_cast<int>(orientation) : 1;
}

std::string ReadExifData(std::span<const uint8_t> bytes) {
  const std::span<const uint8_t> tiff = FindTiff(bytes);
  return {tiff.begin(), tiff.end()};
}

std::string WithUprightExif(std::string jpeg, std::string tiff) {
  constexpr size_t kMostBytes = 0xffff - 8;  // the length includes itself and "Exif\0\0"
  if (jpeg.size() < 2 || tiff.size() < 8 || tiff.size() > kMostBytes) return jpeg;
  SetUpright(tiff);
  const size_t length = tiff.size() + 8;
  std::string segment = {'\xff', '\xe1', static_cast<char>(length >> 8), static_cast<char>(length)};
  segment.append("Exif\0\0", 6);
  return jpeg.insert(2, segment + tiff);
}

}  // namespace pepeseg
