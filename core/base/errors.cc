#include "core/base/errors.h"

#include <cerrno>
#include <system_error>

#include "absl/strings/cord.h"
#include "absl/strings/str_cat.h"

namespace pepeseg {
namespace {

// A status with a payload of this type is private. The payload is empty and never reaches the wire.
constexpr char kPrivateUrl[] = "pepeseg.server/private";

}  // namespace

absl::Status PrivateError(absl::StatusCode code, absl::string_view text) {
  absl::Status status(code, text);
  status.SetPayload(kPrivateUrl, absl::Cord());
  return status;
}

bool IsPrivate(const absl::Status& status) { return status.GetPayload(kPrivateUrl).has_value(); }

absl::Status WithPrefix(absl::string_view prefix, const absl::Status& status) {
  absl::Status prefixed(status.code(), absl::StrCat(prefix, status.message()));
  status.ForEachPayload(
      [&](absl::string_view url, const absl::Cord& payload) { prefixed.SetPayload(url, payload); });
  return prefixed;
}

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
