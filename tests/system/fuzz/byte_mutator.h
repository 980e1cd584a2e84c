#pragma once

#include <random>
#include <string>

#include "absl/strings/string_view.h"

namespace pepeseg::fuzz {

// The bytes with one to four changes that a reader may trip over: bits flipped, numbers at their
// limits, pieces lost, doubled or taken from `other`, the end cut off.
std::string MutateBytes(absl::string_view bytes, absl::string_view other, std::mt19937& random);

}  // namespace pepeseg::fuzz
