#pragma once

#include <memory>
#include <string>

#include "absl/status/statusor.h"
#include "absl/time/time.h"
#include "grpcpp/security/server_credentials.h"
#include "grpcpp/server.h"
#include "grpcpp/server_builder.h"
#include "server/observe/metrics.h"
#include "server/rpc/connection_acceptor.h"
#include "server/rpc/local_socket.h"
#include "server/services/admin_service.h"

namespace pepeseg {

// Serves AdminService on its own address, so that a network may reach the other services and not
// this one. Operations and metrics must outlive it.
class AdminListener {
 public:
  struct Listener {
    std::string address;  // HOST:PORT (port 0: a free one) or unix:PATH, a LocalSocket
    std::shared_ptr<grpc::ServerCredentials> credentials;
  };
  // Starts to listen and serve. UNAVAILABLE: the address is in use. FAILED_PRECONDITION: as
  // LocalSocket::Listen.
  static absl::StatusOr<std::unique_ptr<AdminListener>> Start(const Listener& where,
                                                              Operations& operations,
                                                              RpcMetrics& metrics);

  // Returns the port; 0 for a unix socket.
  int port() const { return acceptor_ == nullptr ? 0 : acceptor_->port(); }
  std::shared_ptr<grpc::Channel> InProcessChannel();

  // Stops listening, and cancels calls that still run at `deadline`. Blocks. Call it once.
  void Shutdown(absl::Time deadline);

 private:
  using Acceptor = grpc::experimental::ExternalConnectionAcceptor;
  explicit AdminListener(Operations& operations);
  // Hands the connections of socket_ to gRPC.
  void ServeSocket(std::unique_ptr<Acceptor> acceptor);

  AdminServiceRpc service_;
  std::unique_ptr<ConnectionAcceptor> acceptor_;
  std::unique_ptr<grpc::Server> server_;
  std::unique_ptr<LocalSocket> socket_;  // of unix:PATH; then acceptor_ is null, and vice versa
};

}  // namespace pepeseg
