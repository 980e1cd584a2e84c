#include "core/formats/glb_parts.h"

#include <algorithm>
#include <cmath>

namespace pepeseg {
namespace {

constexpr size_t kPartHeaderBytes = 8;  // of a chunk: its length and type
constexpr size_t kFileHeaderBytes = 12;

// Little-endian, as all numbers of the file.
void Append(uint64_t number, std::string& bytes) {
  for (int i = 0; i < 4; ++i) bytes.push_back(static_cast<char>(number >> (8 * i)));
}

}  // namespace

std::string GlbHeader(std::string json, size_t num_bytes) {
  // Parts of a GLB begin at multiples of 4, and JSON is padded with spaces.
  json.resize((json.size() + 3) / 4 * 4, ' ');
  const size_t rows = num_bytes == 0 ? 0 : kPartHeaderBytes + num_bytes;
  std::string header = "glTF";
  Append(2, header);  // version
  Append(kFileHeaderBytes + kPartHeaderBytes + json.size() + rows, header);
  Append(json.size(), header);
  header += "JSON" + json;
  if (num_bytes == 0) return header;
  Append(num_bytes, header);
  return header + std::string("BIN\0", 4);
}

float LinearOfSrgb(float srgb) {
  srgb = std::clamp(srgb, 0.0f, 1.0f);
  return srgb <= 0.04045f ? srgb / 12.92f : std::pow((srgb + 0.055f) / 1.055f, 2.4f);
}

}  // namespace pepeseg
