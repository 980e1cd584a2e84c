#include "core/query/packed_mask.h"

#include <algorithm>
#include <array>
#include <cassert>
#include <cstddef>
#include <cstring>

#include "kernels/ops/similarity.h"

namespace pepeseg {
namespace {

// The eight pixels of each byte of bits.
using Pixels = std::array<uint8_t, 8>;
constexpr std::array<Pixels, 256> kPixelsOfByte = [] {
  std::array<Pixels, 256> pixels{};
  for (size_t byte = 0; byte < pixels.size(); ++byte) {
    for (size_t i = 0; i < 8; ++i) pixels[byte][i] = static_cast<uint8_t>((byte >> i) & 1);
  }
  return pixels;
}();

}  // namespace

void UnpackMask(std::span<const uint32_t> bits, std::span<uint8_t> mask) {
  assert(std::ssize(bits) == NumMaskWords(std::ssize(mask)));
  for (size_t first = 0; first < mask.size(); first += 8) {
    const uint32_t byte = (bits[first / 32] >> (first % 32)) & 0xff;
    std::memcpy(&mask[first], kPixelsOfByte[byte].data(), std::min<size_t>(8, mask.size() - first));
  }
}

}  // namespace pepeseg
