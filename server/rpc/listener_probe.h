#pragma once

#include <functional>
#include <optional>

#include "absl/status/status.h"
#include "absl/time/time.h"
#include "server/access/access_options.h"

namespace pepeseg {

// Which listener is asked, and how.
struct ListenerProbeOptions {
  int listening = -1;  // a listening socket of this process
  // Returns the listener's certificate, which the probe shows if the listener asks for one.
  // nullopt: no TLS.
  std::function<std::optional<CertificateTexts>()> certificate;
  // Called with the local port of the connection before it is opened; 0 for a Unix socket.
  std::function<void(int port)> on_port = [](int) {};
  absl::Duration timeout = absl::Seconds(10);  // of each step: connect, handshake, each read
};

// Opens a new connection to a listener of this process and asks grpc.health.v1 over it. Uses plain
// sockets, since connections that a gRPC client keeps could hide a dead listener. Returns OK if the
// server answers, with any health status, or if a listener with a client CA that did not sign the
// server's certificate has shown its own certificate and closed the connection. Else returns
// UNAVAILABLE with the step that failed. Blocks.
absl::Status ProbeListener(const ListenerProbeOptions& options);

}  // namespace pepeseg
