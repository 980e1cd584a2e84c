#include "server/rpc/connection_acceptor.h"

#include <grpcpp/resource_quota.h>
#include <poll.h>
#include <spdlog/spdlog.h>
#include <sys/eventfd.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <limits>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/string_view.h"
#include "absl/time/clock.h"
#include "core/base/status_macros.h"

namespace pepeseg {
namespace {

// Maximum size of a call's metadata, bytes, and maximum number of calls of one connection at the
// same time.
constexpr int kMaxMetadataBytes = 16 << 10;
constexpr int kMaxStreamsPerConnection = 256;
// Limit for requests that are being received, over all connections. Near it gRPC first slows the
// connections down, then ends some.
constexpr size_t kMaxIncomingBytes = size_t{512} << 20;
// Limit on threads that gRPC starts for calls; the callback API starts none.
constexpr int kMaxCallThreads = 32;
// The server pings after this time without a message, and ends a connection that does not answer a
// ping within kKeepaliveTimeoutMs. Clients may ping as often as kMinPingIntervalMs.
constexpr int kKeepaliveMs = 30'000;
constexpr int kKeepaliveTimeoutMs = 10'000;
constexpr int kMinPingIntervalMs = 10'000;
constexpr int kMaxPingStrikes = 2;
// A connection without calls for this time is closed.
constexpr int kMaxIdleMs = 900'000;
// Limit on the TLS handshake and the client's HTTP/2 settings, so that a silent connection does not
// hold a descriptor for longer.
constexpr int kHandshakeMs = 10'000;

// Pause after an accept() that failed although a connection waits.
constexpr int kAcceptPauseMs = 100;
constexpr absl::Duration kRefusalLogInterval = absl::Minutes(1);

int64_t DescriptorLimit() {
  rlimit limit{};
  // The limit can be changed while the server runs (prlimit).
  if (getrlimit(RLIMIT_NOFILE, &limit) != 0 || limit.rlim_cur == RLIM_INFINITY) {
    return std::numeric_limits<int>::max();
  }
  return static_cast<int64_t>(limit.rlim_cur);
}

}  // namespace

int64_t ReservedDescriptors(int64_t limit) { return std::min<int64_t>(limit / 4, 8192); }

absl::StatusOr<std::unique_ptr<ConnectionAcceptor>> ConnectionAcceptor::Listen(
    const std::string& address, std::shared_ptr<grpc::ServerCredentials> credentials,
    grpc::ServerBuilder& builder) {
  ASSIGN_OR_RETURN(ListeningSockets sockets, ListeningSockets::Open(address));
  const int stop_event = eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK);
  if (stop_event < 0) {
    return absl::UnavailableError(
        absl::StrCat("cannot listen on ", address, ": eventfd: ", strerror(errno)));
  }
  std::unique_ptr<ConnectionAcceptor> acceptor(
      new ConnectionAcceptor(std::move(sockets), stop_event));
  // gRPC takes the descriptors of accepted connections, and does the TLS handshake itself.
  acceptor->grpc_ = builder.experimental().AddExternalConnectionAcceptor(
      grpc::ServerBuilder::experimental_type::ExternalConnectionType::FROM_FD,
      std::move(credentials));
  acceptor->grpc_without_tls_ = builder.experimental().AddExternalConnectionAcceptor(
      grpc::ServerBuilder::experimental_type::ExternalConnectionType::FROM_FD,
      grpc::InsecureServerCredentials());
  return acceptor;
}

void ConnectionAcceptor::Start() {
  thread_ = std::thread([this] { Run(); });
}

void ConnectionAcceptor::Stop() {
  // The thread is joined before the sockets are closed: their numbers could be reused for other
  // files while it still polls them.
  if (stopping_.exchange(true)) return;
  eventfd_write(stop_event_, 1);
  if (thread_.joinable()) thread_.join();
  sockets_.Close();
  close(stop_event_);
}

void ConnectionAcceptor::Run() {
  // The event is never read, so once Stop() has written it, every poll() returns at once.
  std::vector<pollfd> waiting = {{stop_event_, POLLIN, 0}};
  for (const int listening : sockets_.descriptors()) waiting.push_back({listening, POLLIN, 0});
  while (!stopping_) {
    if (poll(waiting.data(), waiting.size(), -1) < 0 && errno != EINTR) {
      poll(nullptr, 0, kAcceptPauseMs);  // ENOMEM
      continue;
    }
    for (size_t i = 1; i < waiting.size(); ++i) {
      if (waiting[i].revents != 0) AcceptFrom(waiting[i].fd);
    }
  }
}

// A descriptor's number is the lowest that was free: at `limit` - reserve only the reserve is left.
void ConnectionAcceptor::AcceptFrom(int listening) {
  const int64_t limit = DescriptorLimit();
  const int64_t first_reserved = limit - ReservedDescriptors(limit);
  while (!stopping_) {
    sockaddr_storage peer{};
    socklen_t size = sizeof(peer);
    const int connection =
        accept4(listening, reinterpret_cast<sockaddr*>(&peer), &size, SOCK_NONBLOCK | SOCK_CLOEXEC);
    if (connection < 0) {
      if (errno == EINTR || errno == ECONNABORTED) continue;
      // What waits in the kernel's queue stays there until there are descriptors again.
      if (errno != EAGAIN) poll(nullptr, 0, kAcceptPauseMs);
      return;
    }
    const bool is_probe = IsProbe(peer, size);
    // The probe must get through even then: otherwise a full server would look like a dead
    // listener.
    if (connection >= first_reserved && !is_probe) {
      Refuse(connection);
      continue;
    }
    GrpcAcceptor::NewConnectionParameters accepted;
    // gRPC owns the descriptor from here on, also on an error.
    accepted.listener_fd = listening;
    accepted.fd = connection;
    (is_probe ? grpc_without_tls_ : grpc_)->HandleNewConnection(&accepted);
  }
}

void ConnectionAcceptor::SetProbe(const std::string& address) {
  const std::lock_guard lock(probe_mutex_);
  probe_ = address;
}

bool ConnectionAcceptor::IsProbe(const sockaddr_storage& peer, socklen_t size) {
  const std::lock_guard lock(probe_mutex_);
  return !probe_.empty() && absl::string_view(reinterpret_cast<const char*>(&peer), size) == probe_;
}

void ConnectionAcceptor::Refuse(int connection) {
  // A reset: no state of the connection stays in the kernel, and its client sees at once.
  const linger reset = {.l_onoff = 1, .l_linger = 0};
  setsockopt(connection, SOL_SOCKET, SO_LINGER, &reset, sizeof(reset));
  close(connection);
  const int64_t num_refused = ++num_refused_;
  const absl::Time now = absl::Now();
  if (now - last_log_ < kRefusalLogInterval) return;
  const int64_t limit = DescriptorLimit();
  spdlog::warn(
      "{} new connections refused: {} of {} file descriptors are in use and the rest is kept for "
      "files and workers; raise the limit (ulimit -n, LimitNOFILE) or look for clients that hold "
      "connections",
      num_refused - std::exchange(num_logged_, num_refused), limit - ReservedDescriptors(limit),
      limit);
  last_log_ = now;
}

void SetLimits(grpc::ServerBuilder& builder, const ListenerLimits& limits) {
  const auto max_age_ms = static_cast<int>(absl::ToInt64Milliseconds(limits.max_age));
  builder.SetMaxReceiveMessageSize(limits.max_message_bytes);
  builder.SetMaxSendMessageSize(limits.max_message_bytes);
  grpc::ResourceQuota quota("pepeseg");
  quota.Resize(kMaxIncomingBytes).SetMaxThreads(kMaxCallThreads);
  builder.SetResourceQuota(quota);
  builder.AddChannelArgument(GRPC_ARG_MAX_METADATA_SIZE, kMaxMetadataBytes);
  builder.AddChannelArgument(GRPC_ARG_MAX_CONCURRENT_STREAMS, kMaxStreamsPerConnection);
  // Detects watchers whose machine is gone, and lets clients detect that the server is gone.
  builder.AddChannelArgument(GRPC_ARG_KEEPALIVE_TIME_MS, kKeepaliveMs);
  builder.AddChannelArgument(GRPC_ARG_KEEPALIVE_TIMEOUT_MS, kKeepaliveTimeoutMs);
  builder.AddChannelArgument(GRPC_ARG_KEEPALIVE_PERMIT_WITHOUT_CALLS, 1);
  builder.AddChannelArgument(GRPC_ARG_HTTP2_MAX_PINGS_WITHOUT_DATA, 0);
  // gRPC closes the connections of clients that ping more often.
  builder.AddChannelArgument(GRPC_ARG_HTTP2_MIN_RECV_PING_INTERVAL_WITHOUT_DATA_MS,
                             kMinPingIntervalMs);
  builder.AddChannelArgument(GRPC_ARG_HTTP2_MAX_PING_STRIKES, kMaxPingStrikes);
  builder.AddChannelArgument(GRPC_ARG_MAX_CONNECTION_AGE_MS, max_age_ms);
  builder.AddChannelArgument(GRPC_ARG_MAX_CONNECTION_AGE_GRACE_MS, max_age_ms);
  builder.AddChannelArgument(GRPC_ARG_MAX_CONNECTION_IDLE_MS, kMaxIdleMs);
  builder.AddChannelArgument(GRPC_ARG_SERVER_HANDSHAKE_TIMEOUT_MS, kHandshakeMs);
}

}  // namespace pepeseg
