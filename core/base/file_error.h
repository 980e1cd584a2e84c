#pragma once

#include <filesystem>
#include <string>

#include "absl/status/status.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/string_view.h"

namespace pepeseg {

// Returns the error "PATH: WHAT: reason of the errno `error`" for a system call that failed.
// NOT_FOUND: the file does not exist. RESOURCE_EXHAUSTED: the disk, the quota or the file size
// limit is full. UNAVAILABLE: the process has no free descriptors. INTERNAL: anything else. The
// error is private (private_error.h), because it names a path of the server.
absl::Status FileError(const std::filesystem::path& path, const std::string& what, int error);

// Returns INVALID_ARGUMENT "WHERE: WHY" for content of a user's file that is refused. `where` is
// the file's name, with the line or index if there is one.
inline absl::Status Refused(absl::string_view where, absl::string_view why) {
  return absl::InvalidArgumentError(absl::StrCat(where, ": ", why));
}

}  // namespace pepeseg
