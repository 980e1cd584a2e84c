#pragma once

#include <memory>
#include <string>

#include "absl/status/statusor.h"
#include "absl/time/time.h"
#include "grpcpp/security/server_credentials.h"
#include "grpcpp/server.h"
#include "grpcpp/server_builder.h"
#include "server/observe/rpc_metrics.h"
#include "server/rpc/connection_acceptor.h"
#include "server/rpc/local_socket.h"
#include "server/services/admin_service.h"

namespace pepeseg {

// AdminService on an address of its own, apart from the other services: who may reach them may not
// reach this. It has threads of its own, so that operators get through when the others are busy.
// Context, operations and metrics must outlive it.
class AdminListener {
 public:
  struct Listener {
    std::string address;  // HOST:PORT, port 0: a free one; or unix:PATH, a LocalSocket
    std::shared_ptr<grpc::ServerCredentials> credentials;
  };
  // UNAVAILABLE: the address is taken. FAILED_PRECONDITION: as LocalSocket::Listen.
  static absl::StatusOr<std::unique_ptr<AdminListener>> Start(const Listener& where,
                                                              const ServiceContext& context,
                                                              Operations& operations,
                                                              RpcMetrics& metrics);

  int port() const { return acceptor_ == nullptr ? 0 : acceptor_->port(); }  // 0 for a unix socket
  std::shared_ptr<grpc::Channel> InProcessChannel();

  // Calls under way get until `deadline`. Blocks; once.
  void Shutdown(absl::Time deadline);

 private:
  using Acceptor = grpc::experimental::ExternalConnectionAcceptor;
  AdminListener(const ServiceContext& context, Operations& operations);
  void ServeSocket(std::unique_ptr<Acceptor> acceptor);

  std::unique_ptr<WorkerPool> pool_;
  AdminServiceRpc service_;
  std::unique_ptr<ConnectionAcceptor> acceptor_;
  std::unique_ptr<grpc::Server> server_;
  std::unique_ptr<LocalSocket> socket_;  // where it is one
};

}  // namespace pepeseg
