#pragma once

#include <cstddef>
#include <random>
#include <string>

#include "absl/strings/string_view.h"

namespace pepeseg::fuzz {

// Returns a number in [0, count); count must not be 0.
inline size_t Below(size_t count, std::mt19937& random) {
  return std::uniform_int_distribution<size_t>(0, count - 1)(random);
}

// Returns the bytes with one to four changes on which a reader may fail: flipped bits, numbers at
// their limits, pieces removed, doubled or copied from `other`, the end cut off.
std::string MutateBytes(absl::string_view bytes, absl::string_view other, std::mt19937& random);

}  // namespace pepeseg::fuzz
