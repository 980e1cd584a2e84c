#include "server/rpc/admin_listener.h"

#include <grpcpp/grpcpp.h>

#include "absl/strings/str_cat.h"

namespace pepeseg {

absl::StatusOr<std::unique_ptr<AdminListener>> AdminListener::Start(const Listener& where,
                                                                    const ServiceContext& context) {
  std::unique_ptr<AdminListener> listener(new AdminListener(context));
  constexpr int kMaxMessageBytes = 64 << 10;
  grpc::ServerBuilder builder;
  builder.SetMaxReceiveMessageSize(kMaxMessageBytes);
  builder.AddChannelArgument(GRPC_ARG_ALLOW_REUSEPORT, 0);
  builder.AddListeningPort(where.address, where.credentials, &listener->port_);
  builder.RegisterService(&listener->service_);
  listener->server_ = builder.BuildAndStart();
  if (listener->server_ == nullptr) {
    return absl::UnavailableError(
        absl::StrCat("cannot listen on ", where.address, " for admin calls"));
  }
  return listener;
}

std::shared_ptr<grpc::Channel> AdminListener::InProcessChannel() {
  return server_->InProcessChannel(grpc::ChannelArguments());
}

void AdminListener::Shutdown(absl::Time deadline) {
  server_->Shutdown(absl::ToChronoTime(deadline));
  server_->Wait();
}

}  // namespace pepeseg
