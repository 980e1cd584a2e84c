#pragma once

#include <string>

#include "absl/status/status.h"
#include "absl/strings/string_view.h"

namespace pepeseg {

// Whether `name`, that a client or a file of its gave, is a relative name inside a folder: not
// empty, at most 1024 bytes of UTF-8 without control characters, not absolute, and none of its
// parts empty, "." or "..". INVALID_ARGUMENT says which it breaks, with the name escaped.
absl::Status ValidateName(absl::string_view name);

// "images/a/b.jpg" without the leading "images/" (`folder` without the slash), if it has it.
absl::string_view WithoutFolder(absl::string_view name, absl::string_view folder);
// "a/b.c.jpg" without ".jpg"; a dot in a folder's name or at the front of a file's is no suffix.
absl::string_view WithoutSuffix(absl::string_view name);
// ".jpg" of the same, in lower case; or empty.
std::string Suffix(absl::string_view name);

}  // namespace pepeseg
