#pragma once

#include <string>

#include "absl/status/status.h"
#include "absl/strings/string_view.h"

namespace pepeseg {

// Checks a file name that comes from a client or from a client's file. Returns INVALID_ARGUMENT,
// with the name escaped and the rule that it breaks, unless it is a relative path that stays inside
// its folder: 1 to 1024 bytes of UTF-8 without control characters, not absolute, and no part of it
// empty, "." or "..".
absl::Status ValidateName(absl::string_view name);

// Removes a leading folder: "images/a/b.jpg" becomes "a/b.jpg" for `folder` "images". Returns other
// names unchanged.
absl::string_view WithoutFolder(absl::string_view name, absl::string_view folder);
// Removes the suffix: "a/b.c.jpg" becomes "a/b.c". A dot in the name of a folder, or in front of
// the name of a file, does not begin a suffix.
absl::string_view WithoutSuffix(absl::string_view name);
// Returns the suffix in lower case, with its dot: ".jpg". Empty: the name has none.
std::string Suffix(absl::string_view name);

// Returns true for files that systems and programs leave next to photographs: hidden ones, such as
// macOS's "._7.jpg" and .DS_Store, Thumbs.db, desktop.ini, and those in __MACOSX, @eaDir, #recycle,
// $RECYCLE.BIN or lost+found.
bool IsSystemFile(absl::string_view name);

}  // namespace pepeseg
