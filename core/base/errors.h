#pragma once

#include <filesystem>
#include <string>

#include "absl/status/status.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/string_view.h"

namespace pepeseg {

// Returns an error whose text is for the server's log only, because it reports details of the
// database, the files or the machine. Clients get a general text instead
// (server/api/error.h).
absl::Status PrivateError(absl::StatusCode code, absl::string_view text);
bool IsPrivate(const absl::Status& status);

// Returns `status` with `prefix` before its message. Keeps the code and the payloads, so that a
// private error stays private.
absl::Status WithPrefix(absl::string_view prefix, const absl::Status& status);

// Returns the error "PATH: WHAT: reason of the errno `error`" for a system call that failed.
// NOT_FOUND: the file does not exist. RESOURCE_EXHAUSTED: the disk, the quota or the file size
// limit is full. UNAVAILABLE: the process has no free descriptors. INTERNAL: anything else. The
// error is private, because it names a path of the server.
absl::Status FileError(const std::filesystem::path& path, const std::string& what, int error);

// Returns INVALID_ARGUMENT "WHERE: WHY" for content of a user's file that is refused, which is for
// the user to read. `where` is the file's name, with the line or index if there is one.
inline absl::Status Refused(absl::string_view where, absl::string_view why) {
  return absl::InvalidArgumentError(absl::StrCat(where, ": ", why));
}

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
