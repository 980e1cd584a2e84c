#pragma once

#include <zlib.h>

#include <cstdint>
#include <string>

namespace pepeseg::testing {

inline void AppendBigEndian(uint32_t value, std::string* bytes) {
  for (int shift = 24; shift >= 0; shift -= 8) {
    bytes->push_back(static_cast<char>((value >> shift) & 0xff));
  }
}

inline void AppendPngChunk(const std::string& type, const std::string& body, std::string* png) {
  AppendBigEndian(static_cast<uint32_t>(body.size()), png);
  const std::string checked = type + body;
  *png += checked;
  const uLong crc =
      crc32(0, reinterpret_cast<const Bytef*>(checked.data()), static_cast<uInt>(checked.size()));
  AppendBigEndian(static_cast<uint32_t>(crc), png);
}

// The kind of a PNG's pixels.
struct PngKind {
  int bit_depth = 8;             // bits a sample
  int colour_type = 0;           // PNG's: 0 grey, 2 RGB, 3 palette, 4 grey and alpha, 6 RGBA
  std::string palette = {};      // RGB of each entry
  std::string transparent = {};  // content of tRNS; empty: none
};

// Returns a PNG. `rows`: for each scanline a filter byte of 0, then its samples, big-endian.
inline std::string RawPng(uint32_t width, uint32_t height, const PngKind& kind,
                          const std::string& rows) {
  uLongf size = compressBound(static_cast<uLong>(rows.size()));
  std::string packed(size, '\0');
  compress2(reinterpret_cast<Bytef*>(packed.data()), &size,
            reinterpret_cast<const Bytef*>(rows.data()), static_cast<uLong>(rows.size()), 9);
  packed.resize(size);
  std::string header;
  AppendBigEndian(width, &header);
  AppendBigEndian(height, &header);
  header += static_cast<char>(kind.bit_depth);
  header += static_cast<char>(kind.colour_type);
  header += std::string(3, '\0');  // deflate, no filter, not interlaced
  std::string png = "\x89PNG\r\n\x1a\n";
  AppendPngChunk("IHDR", header, &png);
  if (!kind.palette.empty()) AppendPngChunk("PLTE", kind.palette, &png);
  if (!kind.transparent.empty()) AppendPngChunk("tRNS", kind.transparent, &png);
  AppendPngChunk("IDAT", packed, &png);
  AppendPngChunk("IEND", "", &png);
  return png;
}

// Returns a grey-scale PNG of `bit_depth` bits a pixel.
inline std::string GreyPng(uint32_t width, uint32_t height, int bit_depth,
                           const std::string& rows) {
  return RawPng(width, height, {.bit_depth = bit_depth}, rows);
}

// Returns a black PNG, valid at any size.
inline std::string BlackPng(uint32_t width, uint32_t height, int bit_depth) {
  const size_t row_bytes =
      1 + (static_cast<size_t>(width) * static_cast<size_t>(bit_depth) + 7) / 8;
  return GreyPng(width, height, bit_depth, std::string(row_bytes * height, '\0'));
}

}  // namespace pepeseg::testing
