#pragma once

#include <cstddef>

#include "absl/strings/string_view.h"

namespace pepeseg {

// Returns the number of characters to insert, delete or replace that turn one text into the other.
size_t EditDistance(absl::string_view a, absl::string_view b);

}  // namespace pepeseg
