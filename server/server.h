#pragma once

#include <memory>

#include "absl/status/statusor.h"
#include "absl/time/time.h"
#include "grpcpp/channel.h"
#include "server/server_options.h"

namespace pepeseg {

// A running server: store, supervisor, models, services, listeners.
class Server {
 public:
  // Starts a server that answers calls when this returns.
  // FAILED_PRECONDITION: a listener would be reachable from other machines without TLS or keys, and
  // `insecure` is not set; certificates cannot be read or do not match (the message names the
  // file); another server uses the data directory; the worker or the priors command is not a
  // program; the device is not available; files of SAM are missing or differ from their digests.
  // UNAVAILABLE: an address cannot be bound. INVALID_ARGUMENT, NOT_FOUND: see Lpips::Open.
  static absl::StatusOr<std::unique_ptr<Server>> Start(const ServerOptions& options);
  // Calls Shutdown() with a deadline that has passed.
  ~Server();

  // Return the ports of the listeners; 0: a unix socket, or no such listener.
  int port() const;
  int admin_port() const;
  int metrics_port() const;
  // Return a channel to the services, and to AdminService (null if it is not served), without a
  // socket.
  std::shared_ptr<grpc::Channel> InProcessChannel();
  std::shared_ptr<grpc::Channel> InProcessAdminChannel();

  // Stops the server. Health reports NOT_SERVING at once. After ServerOptions::drain, or at
  // `deadline` if that is sooner, new calls are refused, streams end with UNAVAILABLE, and running
  // jobs are stopped and queued for the next start. Calls in progress have until `deadline`.
  // Blocks. Does nothing when called again.
  void Shutdown(absl::Time deadline);

 private:
  struct Parts;
  explicit Server(std::unique_ptr<Parts> parts);
  std::unique_ptr<Parts> parts_;
};

}  // namespace pepeseg
