#pragma once

#include <string>

#include "absl/status/status.h"
#include "server/server_options.h"

namespace pepeseg {

// Returns whether HOST:PORT or unix:PATH can be reached from this machine only.
bool IsLoopback(const std::string& listen);

// Returns FAILED_PRECONDITION if a listener would be reachable from other machines without
// encryption or without keys, and options.insecure is not set; or if only one of certificate and
// key is given.
absl::Status CheckListeners(const ServerOptions& options);

// Returns UNAVAILABLE if one of the addresses cannot be bound now. The message is one line with the
// flag, the address, the likely cause and the remedy; gRPC's own would have several lines that name
// its source files. Does not check addresses that are not HOST:PORT.
absl::Status CheckAddressesFree(const ServerOptions& options);

}  // namespace pepeseg
