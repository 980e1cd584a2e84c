#pragma once

#include <grpcpp/server_builder.h>
#include <sys/socket.h>

#include <atomic>
#include <cstdint>
#include <memory>
#include <mutex>
#include <string>
#include <thread>

#include "absl/status/statusor.h"
#include "absl/time/time.h"
#include "server/rpc/listening_sockets.h"

namespace pepeseg {

// Accepts the connections of a gRPC server, in place of gRPC's own listener: that one (1.51) stops
// listening for good, and silently, at the first accept() that fails for lack of a descriptor.
// This one closes new connections at once while only the reserve of descriptors is left, which
// files, the database and workers need, and waits where even that is used up. One thread.
class ConnectionAcceptor {
 public:
  // Listens on `address` (ListeningSockets::Open, whose errors it returns) for the server that
  // `builder` makes. Connections wait until Start().
  static absl::StatusOr<std::unique_ptr<ConnectionAcceptor>> Listen(
      const std::string& address, std::shared_ptr<grpc::ServerCredentials> credentials,
      grpc::ServerBuilder& builder);
  // Calls Stop().
  ~ConnectionAcceptor() { Stop(); }
  ConnectionAcceptor(const ConnectionAcceptor&) = delete;
  ConnectionAcceptor& operator=(const ConnectionAcceptor&) = delete;

  // Starts to accept. Call once, after the server has started.
  void Start();
  // Closes the listening sockets; connections that were accepted stay. Call before the server's
  // Shutdown.
  void Stop();

  int port() const { return sockets_.port(); }  // 0: a Unix socket
  // One of the listening sockets, for ListenerProbe; valid until Stop().
  int descriptor() const { return sockets_.descriptors().front(); }
  // Sets the address of the socket of ListenerProbe, as getsockname() has it; empty: none. Its
  // connection may use the reserve, and is served without TLS. No other socket has that address
  // while the probe's is open.
  void SetProbe(const std::string& address);
  int64_t num_refused() const { return num_refused_; }

 private:
  using GrpcAcceptor = grpc::experimental::ExternalConnectionAcceptor;

  ConnectionAcceptor(ListeningSockets sockets, int stop_event)
      : sockets_(std::move(sockets)), stop_event_(stop_event) {}
  void Run();
  // Accepts what waits at the socket.
  void AcceptFrom(int listening);
  void Refuse(int connection);
  bool IsProbe(const sockaddr_storage& peer, socklen_t size);

  ListeningSockets sockets_;
  const int stop_event_;
  std::unique_ptr<GrpcAcceptor> grpc_, grpc_without_tls_;
  std::atomic<bool> stopping_ = false;
  std::mutex probe_mutex_;
  std::string probe_;  // guarded by probe_mutex_
  std::atomic<int64_t> num_refused_ = 0;
  int64_t num_logged_ = 0;  // of num_refused_, those that the log has reported
  absl::Time last_log_ = absl::InfinitePast();
  std::thread thread_;
};

// Returns how many descriptors connections may not use, of a limit on open descriptors: a quarter,
// at most 8,192.
int64_t ReservedDescriptors(int64_t limit);

struct ListenerLimits {
  int max_message_bytes = 8 << 20;  // of requests and of answers
  // Maximum age of a connection, so that clients find new servers behind a gateway. gRPC varies it
  // by 10 %, so that clients that connected together do not reconnect together. Calls under way
  // then get the same time again to end by themselves.
  absl::Duration max_age = absl::Hours(1);
};

// Sets what clients may take of a server: memory, connections, streams, metadata, pings.
void SetLimits(grpc::ServerBuilder& builder, const ListenerLimits& limits);

}  // namespace pepeseg
