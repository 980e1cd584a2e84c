#include "core/query/packed_mask.h"

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
  const size_t num_whole = mask.size() / 32;
  for (size_t word = 0; word < num_whole; ++word) {
    for (size_t i = 0; i < 4; ++i) {
      const Pixels& pixels = kPixelsOfByte[(bits[word] >> (8 * i)) & 0xff];
      std::memcpy(&mask[32 * word + 8 * i], pixels.data(), sizeof(pixels));
    }
  }
  for (size_t i = 32 * num_whole; i < mask.size(); ++i) {
    mask[i] = static_cast<uint8_t>((bits[i / 32] >> (i % 32)) & 1);
  }
}

}  // namespace pepeseg
