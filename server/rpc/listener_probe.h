#pragma once

#include <functional>
#include <string>

#include "absl/status/status.h"
#include "absl/time/time.h"

namespace pepeseg {

// Which listener is asked, and how.
struct ListenerProbeOptions {
  int listening = -1;  // a listening socket of this process
  // Called with the address of the probe's socket, as getsockname() has it, before it connects; and
  // with "" when the probe has ended.
  std::function<void(const std::string& address)> on_address = [](const std::string&) {};
  absl::Duration timeout = absl::Seconds(10);  // of the connection, and of the call
};

// Opens a new connection to a listener of this process and calls grpc.health.v1 over it, without
// TLS: ConnectionAcceptor serves the probe's own connection so. Returns OK if the server answers,
// with any health status, else UNAVAILABLE with the step that failed. Blocks.
absl::Status ProbeListener(const ListenerProbeOptions& options);

}  // namespace pepeseg
