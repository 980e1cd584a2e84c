#include "server/rpc/listening_sockets.h"

#include <netdb.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <memory>
#include <utility>

#include "absl/strings/match.h"
#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "core/base/status_macros.h"

namespace pepeseg {
namespace {

// The kernel lowers it to net.core.somaxconn.
constexpr int kMaxWaitingConnections = 4096;
// Time after which unacknowledged data ends a connection; the same as in gRPC's own listener.
constexpr unsigned int kUserTimeoutMs = 10'000;

struct FreeAddresses {
  void operator()(addrinfo* addresses) const { freeaddrinfo(addresses); }
};
using Addresses = std::unique_ptr<addrinfo, FreeAddresses>;

void SetOption(int socket, int level, int name, int value) {
  setsockopt(socket, level, name, &value, sizeof(value));
}

// Returns a socket that listens on the address, or -1 with errno.
int BindAndListen(const sockaddr* address, socklen_t size) {
  const int made = socket(address->sa_family, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
  if (made < 0) return -1;
  if (address->sa_family != AF_UNIX) {
    // Lets a server that restarts listen although connections of the last one linger.
    SetOption(made, SOL_SOCKET, SO_REUSEADDR, 1);
    SetOption(made, IPPROTO_TCP, TCP_NODELAY, 1);
    SetOption(made, IPPROTO_TCP, TCP_USER_TIMEOUT, kUserTimeoutMs);
  }
  if (address->sa_family == AF_INET6) SetOption(made, IPPROTO_IPV6, IPV6_V6ONLY, 0);
  if (bind(made, address, size) == 0 && listen(made, kMaxWaitingConnections) == 0) return made;
  // close() may change errno, which the caller reports.
  const int error = errno;
  close(made);
  errno = error;
  return -1;
}

int PortOf(int socket) {
  sockaddr_storage address{};
  socklen_t size = sizeof(address);
  if (getsockname(socket, reinterpret_cast<sockaddr*>(&address), &size) != 0) return 0;
  return ntohs(address.ss_family == AF_INET6 ? reinterpret_cast<sockaddr_in6&>(address).sin6_port
                                             : reinterpret_cast<sockaddr_in&>(address).sin_port);
}

void SetPort(sockaddr* address, int port) {
  const in_port_t network_order = htons(static_cast<uint16_t>(port));
  if (address->sa_family == AF_INET6) {
    reinterpret_cast<sockaddr_in6*>(address)->sin6_port = network_order;
  } else {
    reinterpret_cast<sockaddr_in*>(address)->sin_port = network_order;
  }
}

absl::StatusOr<Addresses> Resolve(const std::string& host) {
  addrinfo hints{};
  hints.ai_family = AF_UNSPEC;
  hints.ai_socktype = SOCK_STREAM;
  hints.ai_flags = AI_PASSIVE;
  addrinfo* found = nullptr;
  const int error = getaddrinfo(host.c_str(), "0", &hints, &found);
  if (error == 0) return Addresses(found);
  return absl::UnavailableError(gai_strerror(error));
}

}  // namespace

ListeningSockets& ListeningSockets::operator=(ListeningSockets&& other) noexcept {
  std::swap(descriptors_, other.descriptors_);
  std::swap(port_, other.port_);
  std::swap(unix_path_, other.unix_path_);
  return *this;
}

void ListeningSockets::Close() {
  for (const int descriptor : std::exchange(descriptors_, {})) close(descriptor);
  if (!unix_path_.empty()) unlink(std::exchange(unix_path_, "").c_str());
}

absl::Status ListeningSockets::OpenUnix(const std::string& path) {
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  if (path.empty() || path.size() >= sizeof(address.sun_path)) {
    return absl::InvalidArgumentError(absl::StrCat("the path of a Unix socket must be 1 to ",
                                                   sizeof(address.sun_path) - 1, " bytes long"));
  }
  path.copy(address.sun_path, path.size());
  struct stat there {};
  // Replaces a socket, such as one that a killed server has left, but no other file. Does not check
  // whether a server still listens at it.
  if (lstat(path.c_str(), &there) == 0 && S_ISSOCK(there.st_mode)) unlink(path.c_str());
  const int made = BindAndListen(reinterpret_cast<sockaddr*>(&address), sizeof(address));
  if (made < 0) return absl::UnavailableError(strerror(errno));
  descriptors_.push_back(made);
  unix_path_ = path;
  return absl::OkStatus();
}

absl::Status ListeningSockets::OpenInternet(const std::string& host) {
  ASSIGN_OR_RETURN(const Addresses addresses, Resolve(host));
  int error = EADDRNOTAVAIL;
  for (addrinfo* next = addresses.get(); next != nullptr; next = next->ai_next) {
    // Port 0 lets the kernel choose at the first address; the others then get the same port.
    SetPort(next->ai_addr, port_);
    const int made = BindAndListen(next->ai_addr, next->ai_addrlen);
    if (made < 0) {
      error = errno;
      // Another program has the port on one of the host's addresses and would get some calls.
      if (error == EADDRINUSE) break;
      continue;  // an address that this machine does not have
    }
    descriptors_.push_back(made);
    port_ = PortOf(made);
  }
  if (!descriptors_.empty() && error != EADDRINUSE) return absl::OkStatus();
  return absl::UnavailableError(strerror(error));
}

absl::Status ListeningSockets::OpenHost(const std::string& host, const std::string& port) {
  if (host.empty() || !absl::SimpleAtoi(port, &port_) || port_ < 0 || port_ > 65535) {
    return absl::InvalidArgumentError("it must be HOST:PORT with a port of 0 to 65535");
  }
  if (host != "0.0.0.0") return OpenInternet(host);
  // A socket for [::] takes IPv4 too; the other is for machines without IPv6.
  if (const absl::Status status = OpenInternet("::"); status.ok()) return status;
  return OpenInternet(host);
}

absl::StatusOr<ListeningSockets> ListeningSockets::Open(const std::string& address) {
  ListeningSockets sockets;
  absl::Status status;
  // The last colon, since an IPv6 address has more of them: "[::1]:8080".
  const size_t colon = address.rfind(':');
  if (absl::StartsWith(address, "unix:")) {
    const bool is_url = absl::StartsWith(address, "unix:///");
    status = sockets.OpenUnix(address.substr(is_url ? 7 : 5));
  } else if (colon == std::string::npos) {
    status = absl::InvalidArgumentError("it is neither HOST:PORT nor unix:PATH");
  } else {
    std::string host = address.substr(0, colon);
    if (absl::StartsWith(host, "[") && absl::EndsWith(host, "]")) {
      host = host.substr(1, host.size() - 2);
    }
    status = sockets.OpenHost(host, address.substr(colon + 1));
  }
  if (status.ok()) return sockets;
  return absl::Status(status.code(),
                      absl::StrCat("cannot listen on ", address, ": ", status.message()));
}

}  // namespace pepeseg
