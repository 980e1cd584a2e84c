#pragma once

#include "absl/status/status.h"
#include "absl/strings/string_view.h"

namespace pepeseg {

// Returns an error whose text is for the server's log only, because it reports details of the
// database, the files or the machine. Clients get a general text instead
// (server/api/client_error.h).
absl::Status PrivateError(absl::StatusCode code, absl::string_view text);
bool IsPrivate(const absl::Status& status);

// Returns `status` with `prefix` before its message. Keeps the code and the payloads, so that a
// private error stays private.
absl::Status WithPrefix(absl::string_view prefix, const absl::Status& status);

}  // namespace pepeseg
