#pragma once

#include <functional>
#include <optional>

#include "absl/status/status.h"
#include "absl/time/time.h"
#include "server/access/access_options.h"

namespace pepeseg {

// What is asked and how.
struct ListenerProbeOptions {
  int listening = -1;  // a listening socket of this process
  // The listener's certificate, which is shown where the listener asks for one; none: no TLS.
  std::function<std::optional<CertificateTexts>()> certificate;
  // Called with the local port of the new connection before it is made; 0: a Unix socket.
  std::function<void(int port)> on_port = [](int) {};
  absl::Duration timeout = absl::Seconds(10);  // of each step: connect, handshake, each read
};

// Opens a new connection to a listener of this process and asks grpc.health.v1 over it, by plain
// sockets: what gRPC keeps for its own clients could hide a listener that is dead. OK: the server
// answers, whichever status it gives its services. Also OK: a listener with a client CA that did
// not sign the server's certificate has shown its own certificate and hung up. Else UNAVAILABLE
// with the step that failed. Blocks.
absl::Status ProbeListener(const ListenerProbeOptions& options);

}  // namespace pepeseg
