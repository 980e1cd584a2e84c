#pragma once

#include <bit>
#include <cstdint>

namespace pepeseg {

// Conversion between float and IEEE 754 half precision (binary16). A half is passed as its bits: 1
// of sign, 5 of exponent (bias 15), 10 of mantissa. NaN stays NaN.

// Returns `value` rounded to the nearest half, ties to even. Values from 65520 on become infinity.
inline uint16_t HalfFromFloat(float value) {
  const auto bits = std::bit_cast<uint32_t>(value);
  const auto sign = static_cast<uint16_t>(bits >> 16 & 0x8000);
  const uint32_t magnitude = bits & 0x7FFFFFFF;
  if (magnitude > 0x7F800000) return sign | 0x7E00;   // NaN
  if (magnitude >= 0x47800000) return sign | 0x7C00;  // 65536 and above: infinity
  if (magnitude < 0x38800000) {                       // below 2^-14: a multiple of 2^-24
    // The last mantissa bit of a float in [0.5, 1) is worth 2^-24, so adding 0.5 rounds to it.
    const float shifted = std::bit_cast<float>(magnitude) + 0.5f;
    return sign | static_cast<uint16_t>(std::bit_cast<uint32_t>(shifted) - 0x3F000000);
  }
  const uint32_t rebased = magnitude - 0x38000000;  // exponent bias from 127 to 15
  const uint32_t rounded = rebased + 0xFFF + (rebased >> 13 & 1);
  return sign | static_cast<uint16_t>(rounded >> 13);  // a carry into infinity is correct
}

// Returns the value of a half, exactly.
inline float FloatFromHalf(uint16_t half) {
  const uint32_t sign = static_cast<uint32_t>(half & 0x8000) << 16;
  const uint32_t magnitude = half & 0x7FFF;
  if (magnitude >= 0x7C00) return std::bit_cast<float>(sign | 0x7F800000 | (magnitude << 13));
  if (magnitude < 0x400) {
    const float value = static_cast<float>(magnitude) * 0x1p-24f;
    return sign != 0 ? -value : value;
  }
  return std::bit_cast<float>(sign | ((magnitude << 13) + 0x38000000));
}

}  // namespace pepeseg
