#pragma once

#include <bit>
#include <cstddef>
#include <cstdint>
#include <span>

#include "core/scene/mask_set.h"

namespace pepeseg {

inline std::span<const uint64_t> PatchBits(const MaskSet& masks, size_t patch) {
  const auto words = static_cast<size_t>(masks.words);
  return std::span(masks.patch_bits).subspan(patch * words, words);
}

// fn(mask) for each mask in a bitset over a view's masks, ascending.
template <class Fn>
void ForEachMaskIn(std::span<const uint64_t> bits, Fn fn) {
  for (size_t word = 0; word < bits.size(); ++word) {
    for (uint64_t left = bits[word]; left != 0; left &= left - 1) {
      fn(static_cast<int>(64 * word) + std::countr_zero(left));
    }
  }
}

}  // namespace pepeseg
