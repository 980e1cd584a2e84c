#include "core/base/file_error.h"

#include <cerrno>
#include <system_error>

#include "absl/strings/str_cat.h"
#include "core/base/private_error.h"

namespace pepeseg {

absl::Status FileError(const std::filesystem::path& path, const std::string& what, int error) {
  const std::string message =
      absl::StrCat(path.string(), ": ", what, ": ", std::generic_category().message(error));
  if (error == ENOENT) return PrivateError(absl::StatusCode::kNotFound, message);
  const bool full = error == ENOSPC || error == EDQUOT || error == EFBIG;
  if (full) return PrivateError(absl::StatusCode::kResourceExhausted, message);
  // The file itself may be fine: opening it again works once descriptors are free.
  const bool no_descriptors = error == EMFILE || error == ENFILE;
  return PrivateError(no_descriptors ? absl::StatusCode::kUnavailable : absl::StatusCode::kInternal,
                      message);
}

}  // namespace pepeseg
