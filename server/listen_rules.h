#pragma once

#include "absl/status/status.h"
#include "server/server.h"

namespace pepeseg {

// FAILED_PRECONDITION: a listener beyond this machine without encryption or without keys, unless
// `insecure`; half a pair of certificate and key.
absl::Status CheckListeners(const ServerOptions& options);

// UNAVAILABLE, in one line with the flag, the address, the likely cause and the remedy: one of the
// addresses cannot be bound now. What is not HOST:PORT is left to who listens on it.
absl::Status CheckAddressesFree(const ServerOptions& options);

}  // namespace pepeseg
