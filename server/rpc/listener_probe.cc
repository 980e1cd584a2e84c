#include "server/rpc/listener_probe.h"

#include <google/protobuf/empty.pb.h>
#include <grpcpp/create_channel_posix.h>
#include <grpcpp/generic/generic_stub.h>
#include <grpcpp/grpcpp.h>
#include <grpcpp/impl/codegen/proto_utils.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <sys/time.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <future>
#include <memory>
#include <utility>

#include "absl/strings/str_cat.h"
#include "core/base/status_macros.h"

namespace pepeseg {
namespace {

absl::Status Failed(absl::string_view step) {
  // EAGAIN and EINPROGRESS mean that the socket's timeout has passed.
  const int error = errno;
  return absl::UnavailableError(absl::StrCat(
      step, ": ", error == EAGAIN || error == EINPROGRESS ? "no answer" : strerror(error)));
}

// Sets the address to connect to: that of the listening socket, or loopback for a wildcard.
void MakeReachable(sockaddr_storage& address) {
  if (address.ss_family == AF_INET) {
    auto& in = reinterpret_cast<sockaddr_in&>(address);
    if (in.sin_addr.s_addr == htonl(INADDR_ANY)) in.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  } else if (address.ss_family == AF_INET6) {
    auto& in6 = reinterpret_cast<sockaddr_in6&>(address);
    if (IN6_IS_ADDR_UNSPECIFIED(&in6.sin6_addr)) in6.sin6_addr = in6addr_loopback;
  }
}

// Binds the socket to a free port of `address`, or to a free abstract name for a Unix socket, so
// that its address is known before the connection is made.
absl::StatusOr<std::string> BindLocally(int socket, sockaddr_storage address, socklen_t size) {
  if (address.ss_family == AF_INET) reinterpret_cast<sockaddr_in&>(address).sin_port = 0;
  if (address.ss_family == AF_INET6) reinterpret_cast<sockaddr_in6&>(address).sin6_port = 0;
  if (address.ss_family == AF_UNIX) size = sizeof(sa_family_t);
  auto* local = reinterpret_cast<sockaddr*>(&address);
  if (bind(socket, local, size) != 0) return Failed("bind");
  size = sizeof(address);
  if (getsockname(socket, local, &size) != 0) return Failed("getsockname");
  return std::string(reinterpret_cast<const char*>(local), size);
}

absl::Status Connect(int socket, const sockaddr_storage& address, socklen_t size,
                     const ListenerProbeOptions& options) {
  const timeval timeout = absl::ToTimeval(options.timeout);
  setsockopt(socket, SOL_SOCKET, SO_SNDTIMEO, &timeout, sizeof(timeout));  // limits connect()
  ASSIGN_OR_RETURN(const std::string local, BindLocally(socket, address, size));
  options.on_address(local);
  if (connect(socket, reinterpret_cast<const sockaddr*>(&address), size) != 0) {
    return Failed("connect");
  }
  return absl::OkStatus();
}

// Calls the health service, for which Debian has no stubs. An empty message asks for the whole
// server.
absl::Status AskHealth(const std::shared_ptr<grpc::Channel>& channel, absl::Duration timeout) {
  const google::protobuf::Empty request;
  google::protobuf::Empty response;
  grpc::ClientContext context;
  context.set_deadline(absl::ToChronoTime(absl::Now() + timeout));
  grpc::TemplatedGenericStub<google::protobuf::Empty, google::protobuf::Empty> stub(channel);
  std::promise<grpc::Status> done;
  stub.UnaryCall(&context, "/grpc.health.v1.Health/Check", grpc::StubOptions(), &request, &response,
                 [&](grpc::Status status) { done.set_value(std::move(status)); });
  const grpc::Status status = done.get_future().get();
  if (status.error_code() == grpc::DEADLINE_EXCEEDED) {
    return absl::UnavailableError("health: no answer");
  }
  if (status.error_code() != grpc::UNAVAILABLE) return absl::OkStatus();
  return absl::UnavailableError(absl::StrCat("health: ", status.error_message()));
}

}  // namespace

absl::Status ProbeListener(const ListenerProbeOptions& options) {
  sockaddr_storage address{};
  socklen_t size = sizeof(address);
  if (getsockname(options.listening, reinterpret_cast<sockaddr*>(&address), &size) != 0) {
    return Failed("getsockname");
  }
  MakeReachable(address);
  const int connection = socket(address.ss_family, SOCK_STREAM | SOCK_CLOEXEC, 0);
  if (connection < 0) return Failed("socket");
  absl::Status status = Connect(connection, address, size, options);
  // The channel owns the connection, and is not kept: it could hide a dead listener.
  std::shared_ptr<grpc::Channel> channel;
  if (status.ok()) {
    channel = grpc::CreateInsecureChannelFromFd("listener", connection);
    status = AskHealth(channel, options.timeout);
  }
  // Before the socket is closed: its address may then be that of another one.
  options.on_address("");
  if (channel == nullptr) close(connection);
  return status;
}

}  // namespace pepeseg
