#pragma once

#include "absl/status/status.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/string_view.h"

namespace pepeseg {

// INVALID_ARGUMENT "where: why" for bytes of a user's that cannot be taken; `where` is the file's
// name, with the line or index where there is one.
inline absl::Status Refused(absl::string_view where, absl::string_view why) {
  return absl::InvalidArgumentError(absl::StrCat(where, ": ", why));
}

}  // namespace pepeseg
