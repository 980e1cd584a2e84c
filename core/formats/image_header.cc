#include "core/formats/image_header.h"

#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <vector>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "core/base/status_macros.h"
#include "core/formats/heic_header.h"

namespace pepeseg {
namespace {

using Bytes = std::span<const uint8_t>;

constexpr std::array<uint8_t, 8> kPngMagic = {0x89, 'P', 'N', 'G', '\r', '\n', 0x1A, '\n'};
constexpr std::array<uint8_t, 3> kJpegMagic = {0xFF, 0xD8, 0xFF};

bool StartsWith(Bytes bytes, Bytes magic) {
  return bytes.size() >= magic.size() && std::equal(magic.begin(), magic.end(), bytes.begin());
}

// Returns true if the text `tag` is at offset `at`.
bool HasTag(Bytes bytes, size_t at, absl::string_view tag) {
  return bytes.size() >= at + tag.size() &&
         std::equal(tag.begin(), tag.end(), bytes.begin() + static_cast<ptrdiff_t>(at),
                    [](char a, uint8_t b) { return static_cast<uint8_t>(a) == b; });
}

// Read a number of up to 4 bytes. The caller has checked that it is within the bytes.
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

// A size as the file declares it, before it is checked.
struct Size {
  uint64_t width = 0;
  uint64_t height = 0;
};

// JPEG (ISO/IEC 10918-1 annex B): segments that begin with a marker, 0xFF xx. Most markers are
// followed by a big-endian length that includes itself. SOS is followed by entropy-coded bytes, in
// which 0xFF is followed by 0 or by a restart marker.
constexpr uint8_t kSof0 = 0xC0, kDht = 0xC4, kJpg = 0xC8, kDac = 0xCC, kSof15 = 0xCF;
constexpr uint8_t kRst0 = 0xD0, kRst7 = 0xD7, kEoi = 0xD9, kSos = 0xDA, kTem = 0x01;

// Maximum number of scans of a JPEG. Each scan of a progressive JPEG may change all pixels, so a
// small file with thousands of them takes a decoder minutes. Encoders write 1 to 10.
constexpr int kMaxScans = 100;

// Returns true for SOF0 to SOF15. DHT, JPG and DAC are among their codes, but are not frame
// headers.
bool IsFrameHeader(uint8_t marker) {
  return marker >= kSof0 && marker <= kSof15 && marker != kDht && marker != kJpg && marker != kDac;
}

// Returns the offset of the next marker after the entropy-coded bytes that start at `at`, or the
// size of the file.
size_t SkipScan(Bytes bytes, size_t at) {
  for (; at + 1 < bytes.size(); ++at) {
    if (bytes[at] != 0xFF) continue;
    const uint8_t next = bytes[at + 1];
    const bool restart = next >= kRst0 && next <= kRst7;
    if (next != 0 && next != 0xFF && !restart) return at;
  }
  return bytes.size();
}

// Walks all segments to the end marker. Returns the size in the first frame header.
absl::StatusOr<Size> JpegSize(Bytes bytes) {
  Size size;
  int num_scans = 0;
  size_t at = 2;
  while (at + 2 <= bytes.size()) {
    const uint8_t marker = bytes[at + 1];
    // Fill bytes, and stray bytes between segments, which decoders skip as well.
    if (bytes[at] != 0xFF || marker == 0xFF || marker == 0) {
      ++at;
      continue;
    }
    at += 2;
    if (marker == kEoi) {
      if (size.width == 0 || num_scans == 0) return Malformed("JPEG", "it ends without a picture");
      return size;
    }
    if (marker == kTem || (marker >= kRst0 && marker <= kRst7)) continue;
    if (at + 2 > bytes.size()) break;
    const size_t length = BigEndian(bytes, at, 2);
    if (length < 2) return Malformed("JPEG", absl::StrCat("segment of no length at byte ", at));
    if (at + length > bytes.size()) break;
    if (IsFrameHeader(marker) && size.width == 0) {
      if (length < 8) return Malformed("JPEG", "short frame header");
      // After the length: precision (1 byte), height, width.
      size = {BigEndian(bytes, at + 5, 2), BigEndian(bytes, at + 3, 2)};
      if (size.width == 0 || size.height == 0) return Malformed("JPEG", "the size is 0");
    }
    at += length;
    if (marker == kSos) {
      at = SkipScan(bytes, at);
      if (++num_scans > kMaxScans) {
        return Malformed("JPEG", absl::StrCat("it has over ", kMaxScans, " scans"));
      }
    }
  }
  return CutShort("JPEG");
}

// PNG: chunks of big-endian length, type, data and CRC. The first is IHDR, the last IEND.
constexpr size_t kAround = 12;  // length, type and CRC of a chunk

// Returns the size in the first chunk.
absl::StatusOr<Size> PngHeaderSize(Bytes bytes) {
  const size_t at = kPngMagic.size();
  if (bytes.size() < at + kAround + 13) return CutShort("PNG");
  if (!HasTag(bytes, at + 4, "IHDR") || BigEndian(bytes, at, 4) != 13) {
    return Malformed("PNG", "its first chunk is not the header");
  }
  return Size{BigEndian(bytes, at + 8, 4), BigEndian(bytes, at + 12, 4)};
}

// Walks all chunks to the last one.
absl::StatusOr<Size> PngSize(Bytes bytes) {
  ASSIGN_OR_RETURN(const Size size, PngHeaderSize(bytes));
  size_t at = kPngMagic.size();
  while (bytes.size() - at >= kAround) {
    const uint64_t length = BigEndian(bytes, at, 4);
    if (length > bytes.size() - at - kAround) break;
    if (HasTag(bytes, at + 4, "IEND")) return size;
    at += kAround + length;
  }
  return CutShort("PNG");
}

// WebP: a RIFF container whose first chunk is VP8 (lossy), VP8L (lossless) or VP8X (extended). VP8L
// and VP8X store width - 1 and height - 1.
absl::StatusOr<Size> WebpHeaderSize(Bytes bytes) {
  constexpr size_t kSmallest = 30;
  if (bytes.size() < kSmallest) return CutShort("WebP");
  if (HasTag(bytes, 12, "VP8X")) {
    return Size{LittleEndian(bytes, 24, 3) + 1, LittleEndian(bytes, 27, 3) + 1};
  }
  if (HasTag(bytes, 12, "VP8L")) {
    // After the signature byte 0x2f: two sizes of 14 bits.
    const uint32_t packed = LittleEndian(bytes, 21, 4);
    return Size{(packed & 0x3FFF) + 1, (packed >> 14 & 0x3FFF) + 1};
  }
  if (HasTag(bytes, 12, "VP8 ")) {
    // After the frame tag and start code: 14 bits of size each, the upper two bits are a scaling
    // hint.
    return Size{LittleEndian(bytes, 26, 2) & 0x3FFF, LittleEndian(bytes, 28, 2) & 0x3FFF};
  }
  return Malformed("WebP", "its first chunk is not a picture");
}

// Compares the size in the RIFF header with that of the file.
absl::StatusOr<Size> WebpSize(Bytes bytes) {
  ASSIGN_OR_RETURN(const Size size, WebpHeaderSize(bytes));
  if (uint64_t{LittleEndian(bytes, 4, 4)} + 8 > bytes.size()) return CutShort("WebP");
  return size;
}

absl::StatusOr<Size> SizeOfHeic(Bytes bytes) {
  ASSIGN_OR_RETURN(const HeicSize size, ReadHeicSize(bytes));
  return Size{size.width, size.height};
}

absl::StatusOr<Size> SizeOf(ImageFormat format, Bytes bytes) {
  if (format == ImageFormat::kJpeg) return JpegSize(bytes);
  if (format == ImageFormat::kPng) return PngSize(bytes);
  if (format == ImageFormat::kHeic) {
    RETURN_IF_ERROR(CheckHeicIsWhole(bytes));
    return SizeOfHeic(bytes);
  }
  return WebpSize(bytes);
}

// Returns the format of a file that begins with these bytes.
absl::StatusOr<ImageFormat> FormatOf(Bytes bytes) {
  if (StartsWith(bytes, kJpegMagic)) return ImageFormat::kJpeg;
  if (StartsWith(bytes, kPngMagic)) return ImageFormat::kPng;
  if (HasTag(bytes, 0, "RIFF") && HasTag(bytes, 8, "WEBP")) return ImageFormat::kWebp;
  if (IsHeic(bytes)) return ImageFormat::kHeic;
  return absl::InvalidArgumentError("not a JPEG, PNG, WebP or HEIC image");
}

// Checks a declared size. Both sides are below 2^32, so the product does not overflow.
absl::StatusOr<ImageHeader> CheckSize(ImageFormat format, const Size& size) {
  if (size.width == 0 || size.height == 0) return absl::InvalidArgumentError("an empty image");
  if (size.width * size.height > static_cast<uint64_t>(kMaxImagePixels)) {
    return absl::InvalidArgumentError(
        absl::StrCat(size.width, "x", size.height, " pixels, the limit is ", kMaxImagePixels));
  }
  return ImageHeader{format, static_cast<int>(size.width), static_cast<int>(size.height)};
}

absl::StatusOr<ImageHeader> Read(Bytes bytes) {
  ASSIGN_OR_RETURN(const ImageFormat format, FormatOf(bytes));
  ASSIGN_OR_RETURN(const Size size, SizeOf(format, bytes));
  return CheckSize(format, size);
}

// Reads pieces of a file, at most kMaxHeaderReads of them. Owns the descriptor.
class HeaderReader {
 public:
  explicit HeaderReader(int descriptor) : descriptor_(descriptor) {}
  ~HeaderReader() { close(descriptor_); }
  HeaderReader(const HeaderReader&) = delete;
  HeaderReader& operator=(const HeaderReader&) = delete;

  // Returns `count` bytes from offset `at` on; fewer at the end of the file, none after an error.
  // `count` is at most kHeaderReadBytes. The bytes are valid until the next call.
  Bytes At(uint64_t at, size_t count) {
    // Reads again only if the request is not within the piece at hand.
    if (at < start_ || at + count > start_ + size_) Fill(at);
    if (at < start_ || at >= start_ + size_) return {};
    const size_t first = at - start_;
    return Bytes(piece_).subspan(first, std::min(count, size_ - first));
  }
  // Why At() returned no bytes. OK: the file ends there. INTERNAL: a read failed. INVALID_ARGUMENT:
  // too many reads.
  const absl::Status& status() const { return status_; }

 private:
  void Fill(uint64_t at) {
    start_ = at;
    size_ = 0;
    if (!status_.ok()) return;
    if (++num_reads_ > kMaxHeaderReads) {
      status_ = absl::InvalidArgumentError(
          absl::StrCat("the header is not found by ", kMaxHeaderReads, " reads of ",
                       kHeaderReadBytes, " bytes: save the image again"));
      return;
    }
    while (size_ < piece_.size()) {
      const ssize_t got = pread(descriptor_, piece_.data() + size_, piece_.size() - size_,
                                static_cast<off_t>(at + size_));
      // Interrupted by a signal before anything was read.
      if (got < 0 && errno == EINTR) continue;
      if (got < 0) status_ = absl::InternalError("cannot be read");
      if (got <= 0) return;
      size_ += static_cast<size_t>(got);
    }
  }

  const int descriptor_;
  std::array<uint8_t, kHeaderReadBytes> piece_{};
  uint64_t start_ = 0;  // offset of the piece in the file
  size_t size_ = 0;     // bytes of the piece
  int num_reads_ = 0;
  absl::Status status_;
};

// Does what JpegSize does, up to the first frame header only.
absl::StatusOr<Size> FindJpegSize(HeaderReader& file) {
  for (uint64_t at = 2;;) {
    const Bytes two = file.At(at, 2);
    if (two.size() < 2) break;
    const uint8_t marker = two[1];
    if (two[0] != 0xFF || marker == 0xFF || marker == 0) {
      ++at;
      continue;
    }
    at += 2;
    if (marker == kTem || (marker >= kRst0 && marker <= kRst7)) continue;
    if (marker == kEoi || marker == kSos) return Malformed("JPEG", "no frame header");
    const Bytes segment = file.At(at, 7);
    if (segment.size() < 2) break;
    const size_t length = BigEndian(segment, 0, 2);
    if (length < 2) return Malformed("JPEG", absl::StrCat("segment of no length at byte ", at));
    if (IsFrameHeader(marker)) {
      if (length < 8) return Malformed("JPEG", "short frame header");
      if (segment.size() < 7) break;
      return Size{BigEndian(segment, 5, 2), BigEndian(segment, 3, 2)};
    }
    at += length;
  }
  return file.status().ok() ? CutShort("JPEG") : file.status();
}

// Reads the front of the file until it contains the whole "meta" box, which cameras write first.
absl::StatusOr<Size> FindHeicSize(HeaderReader& file) {
  constexpr uint64_t kMostBytes = 64 * kHeaderReadBytes;
  std::vector<uint8_t> front;
  while (front.size() < kMostBytes) {
    const Bytes piece = file.At(front.size(), kHeaderReadBytes);
    front.insert(front.end(), piece.begin(), piece.end());
    absl::StatusOr<Size> size = SizeOfHeic(front);
    if (size.ok() || piece.size() < kHeaderReadBytes)
      return file.status().ok() ? size : file.status();
  }
  return SizeOfHeic(front);
}

// A new format adds its magic number to FormatOf and a case here.
absl::StatusOr<ImageHeader> ReadSize(HeaderReader& file) {
  constexpr size_t kFrontBytes = 64;
  const Bytes front = file.At(0, kFrontBytes);
  RETURN_IF_ERROR(file.status());
  ASSIGN_OR_RETURN(const ImageFormat format, FormatOf(front));
  absl::StatusOr<Size> size;
  switch (format) {
    case ImageFormat::kJpeg:
      size = FindJpegSize(file);
      break;
    case ImageFormat::kPng:
      size = PngHeaderSize(front);
      break;
    case ImageFormat::kWebp:
      size = WebpHeaderSize(front);
      break;
    case ImageFormat::kHeic:
      size = FindHeicSize(file);
      break;
  }
  RETURN_IF_ERROR(size.status());
  return CheckSize(format, *size);
}

}  // namespace

const char* ContentTypeOf(absl::string_view start) {
  if (absl::StartsWith(start, "\xff\xd8\xff")) return "image/jpeg";
  if (absl::StartsWith(start, "\x89PNG")) return "image/png";
  if (start.size() >= 12 && absl::StartsWith(start, "RIFF") && start.substr(8, 4) == "WEBP") {
    return "image/webp";
  }
  const auto* data = reinterpret_cast<const uint8_t*>(start.data());
  return IsHeic({data, start.size()}) ? "image/heic" : "application/octet-stream";
}

const char* SuffixOf(ImageFormat format) {
  switch (format) {
    case ImageFormat::kJpeg:
      return ".jpg";
    case ImageFormat::kPng:
      return ".png";
    case ImageFormat::kWebp:
      return ".webp";
    case ImageFormat::kHeic:
      return ".heic";
  }
  return "";
}

absl::StatusOr<ImageHeader> ReadImageHeader(absl::string_view name,
                                            std::span<const uint8_t> bytes) {
  absl::StatusOr<ImageHeader> header = Read(bytes);
  if (header.ok()) return header;
  return absl::InvalidArgumentError(absl::StrCat(name, ": ", header.status().message()));
}

absl::StatusOr<ImageHeader> ReadImageSize(const std::filesystem::path& path,
                                          absl::string_view name) {
  // O_NONBLOCK: opening a FIFO must not wait for its other end.
  const int descriptor = open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK);
  if (descriptor < 0) {
    if (errno == ENOENT) return absl::NotFoundError(absl::StrCat(name, ": no such file"));
    return absl::InternalError(absl::StrCat(name, ": cannot be opened"));
  }
  HeaderReader file(descriptor);
  absl::StatusOr<ImageHeader> header = ReadSize(file);
  if (header.ok()) return header;
  return absl::Status(header.status().code(), absl::StrCat(name, ": ", header.status().message()));
}

}  // namespace pepeseg
