#pragma once

#include "absl/status/status.h"
#include "server/rpc/server.h"

namespace pepeseg {

// FAILED_PRECONDITION: a listener beyond this machine without encryption or without keys, unless
// `insecure`; half a pair of certificate and key.
absl::Status CheckListeners(const ServerOptions& options);

}  // namespace pepeseg
