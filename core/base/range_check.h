#pragma once

#include "absl/status/status.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/string_view.h"

namespace pepeseg {

// Returns INVALID_ARGUMENT "NAME is VALUE, must be in [LOW, HIGH]" unless low <= value <= high. NaN
// is out of every range. The Validate functions of options and the checks of prompts use it; what
// must be in a half-open range, or ascend, is checked where it is used.
template <class T>
absl::Status CheckInRange(absl::string_view name, T value, T low, T high) {
  if (value >= low && value <= high) return absl::OkStatus();
  return absl::InvalidArgumentError(
      absl::StrCat(name, " is ", value, ", must be in [", low, ", ", high, "]"));
}

}  // namespace pepeseg
