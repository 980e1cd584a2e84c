#include "server/admin_listener.h"

#include <grpcpp/grpcpp.h>

#include <utility>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "core/base/status_macros.h"
#include "server/rpc/call_interceptor.h"
#include "server/rpc/connection_acceptor.h"
#include "server/rpc/reflection.h"

namespace pepeseg {
namespace {

constexpr absl::string_view kUnix = "unix:";
// Maximum size of a message. Requests are small, but lists of models or jobs may be long.
constexpr int kMaxAdminRequestBytes = 4 << 20;

}  // namespace

AdminListener::AdminListener(Operations& operations) : service_(operations) {}

absl::StatusOr<std::unique_ptr<AdminListener>> AdminListener::Start(const Listener& where,
                                                                    Operations& operations,
                                                                    RpcMetrics& metrics) {
  std::unique_ptr<AdminListener> listener(new AdminListener(operations));
  grpc::ServerBuilder builder;
  SetReflection(builder, false);
  SetLimits(builder, {kMaxAdminRequestBytes, absl::Hours(1)});
  std::vector<std::unique_ptr<grpc::experimental::ServerInterceptorFactoryInterface>> interceptors;
  interceptors.push_back(MakeCallInterceptors(metrics, operations.models().data_folder()));
  builder.experimental().SetInterceptorCreators(std::move(interceptors));
  std::unique_ptr<Acceptor> acceptor;
  if (absl::StartsWith(where.address, kUnix)) {
    ASSIGN_OR_RETURN(listener->socket_, LocalSocket::Listen(where.address.substr(kUnix.size())));
    acceptor = builder.experimental().AddExternalConnectionAcceptor(
        grpc::ServerBuilder::experimental_type::ExternalConnectionType::FROM_FD, where.credentials);
  } else {
    ASSIGN_OR_RETURN(listener->acceptor_,
                     ConnectionAcceptor::Listen(where.address, where.credentials, builder));
  }
  builder.RegisterService(&listener->service_);
  listener->server_ = builder.BuildAndStart();
  if (listener->server_ == nullptr) {
    return absl::UnavailableError(absl::StrCat("cannot serve admin calls on ", where.address));
  }
  if (acceptor != nullptr) listener->ServeSocket(std::move(acceptor));
  if (listener->acceptor_ != nullptr) listener->acceptor_->Start();
  return listener;
}

void AdminListener::ServeSocket(std::unique_ptr<Acceptor> acceptor) {
  socket_->Serve([acceptor = std::shared_ptr<Acceptor>(std::move(acceptor))](int connection) {
    Acceptor::NewConnectionParameters parameters;
    parameters.listener_fd = -1;
    parameters.fd = connection;
    acceptor->HandleNewConnection(&parameters);
  });
}

std::shared_ptr<grpc::Channel> AdminListener::InProcessChannel() {
  return server_->InProcessChannel(grpc::ChannelArguments());
}

void AdminListener::Shutdown(absl::Time deadline) {
  if (socket_ != nullptr) socket_->Stop();
  if (acceptor_ != nullptr) acceptor_->Stop();
  server_->Shutdown(absl::ToChronoTime(deadline));
  server_->Wait();
}

}  // namespace pepeseg
