#pragma once

#include <string>
#include <utility>
#include <vector>

#include "absl/status/statusor.h"

namespace pepeseg {

// Non-blocking sockets that listen on one address: several where its host name has several
// addresses. Closed with the object, which also removes the file of a Unix socket.
class ListeningSockets {
 public:
  // `address`: HOST:PORT, [IPV6]:PORT or unix:PATH. Port 0: a free one, the same for all addresses
  // of the host. The wildcard 0.0.0.0 or [::] listens on IPv4 and IPv6. A Unix socket that an
  // earlier server left is replaced. INVALID_ARGUMENT: the address is malformed; UNAVAILABLE: it
  // cannot be had.
  static absl::StatusOr<ListeningSockets> Open(const std::string& address);
  ~ListeningSockets() { Close(); }
  ListeningSockets(ListeningSockets&& other) noexcept { *this = std::move(other); }
  ListeningSockets& operator=(ListeningSockets&& other) noexcept;

  const std::vector<int>& descriptors() const { return descriptors_; }
  int port() const { return port_; }  // 0: a Unix socket
  void Close();

 private:
  ListeningSockets() = default;
  absl::Status OpenUnix(const std::string& path);
  absl::Status OpenHost(const std::string& host, const std::string& port);
  absl::Status OpenInternet(const std::string& host);  // at port_

  std::vector<int> descriptors_;
  int port_ = 0;
  std::string unix_path_;
};

}  // namespace pepeseg
