#pragma once

#include "absl/status/status.h"
#include "absl/strings/string_view.h"

// Errors whose text is for the server's log only: it tells of its database, its files or its
// machine. Clients get a general text instead (server/api/client_error.h).
namespace pepeseg {

absl::Status PrivateError(absl::StatusCode code, absl::string_view text);
bool IsPrivate(const absl::Status& status);

// `status` with `prefix` before its message; it keeps all else, so that it stays private.
absl::Status WithPrefix(absl::string_view prefix, const absl::Status& status);

}  // namespace pepeseg
