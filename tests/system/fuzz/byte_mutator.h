#pragma once

#include <random>
#include <string>

#include "absl/strings/string_view.h"

namespace pepeseg::fuzz {

// Returns the bytes with one to four changes on which a reader may fail: flipped bits, numbers at
// their limits, pieces removed, doubled or copied from `other`, the end cut off.
std::string MutateBytes(absl::string_view bytes, absl::string_view other, std::mt19937& random);

}  // namespace pepeseg::fuzz
