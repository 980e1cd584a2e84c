#pragma once

#include <bit>
#include <cstdint>

namespace pepeseg {

// IEEE 754 binary16 as stored: 1 bit of sign, 5 of exponent (bias 15), 10 of mantissa. CUDA kernels
// convert it with their own instructions, to the same bits.
struct Half {
  uint16_t bits;
};

// Rounds to IEEE binary16, to nearest, ties to even. Magnitudes from 65520 on become infinite; NaN
// stays NaN.
inline Half HalfFromFloat(float value) {
  const uint32_t bits = std::bit_cast<uint32_t>(value);
  const auto sign = static_cast<uint16_t>(bits >> 16 & 0x8000u);
  const uint32_t magnitude = bits & 0x7fffffffu;
  if (magnitude > 0x7f800000u) return {static_cast<uint16_t>(sign | 0x7e00u)};  // NaN
  if (magnitude >= 0x477ff000u) return {static_cast<uint16_t>(sign | 0x7c00u)};
  if (magnitude < 0x38800000u) {
    // Subnormal, below 2^-14: adding 0.5 rounds the value to units of 2^-24 in the low bits.
    const float shifted = std::bit_cast<float>(magnitude) + 0.5f;
    return {static_cast<uint16_t>(sign | (std::bit_cast<uint32_t>(shifted) - 0x3f000000u))};
  }
  // Adds half a unit in the last place, less for ties to even, and rebases the exponent.
  const uint32_t rounded = magnitude + 0xfffu + (magnitude >> 13 & 1u) - 0x38000000u;
  return {static_cast<uint16_t>(sign | rounded >> 13)};
}

// Exact; infinities and NaN are kept.
inline float FloatFromHalf(Half half) {
  const uint32_t sign = (half.bits & 0x8000u) << 16;
  const uint32_t magnitude = half.bits & 0x7fffu;
  // The product rebases the exponent, of subnormals, too.
  const float value = std::bit_cast<float>(magnitude << 13) * 0x1p112f;
  const uint32_t special = magnitude >= 0x7c00u ? 0x7f800000u : 0u;
  return std::bit_cast<float>(sign | special | std::bit_cast<uint32_t>(value));
}

}  // namespace pepeseg
