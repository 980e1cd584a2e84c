#pragma once

#include <string>
#include <utility>
#include <vector>

#include "absl/status/statusor.h"

namespace pepeseg {

// Non-blocking sockets that listen on one address, one for each IP address of its host name. The
// destructor closes them and removes the file of a Unix socket.
class ListeningSockets {
 public:
  // Opens sockets for `address`: HOST:PORT, [IPV6]:PORT or unix:PATH. Port 0 chooses a free port,
  // the same for all addresses of the host. 0.0.0.0 and [::] listen on both IPv4 and IPv6. Replaces
  // a Unix socket that an earlier server has left. INVALID_ARGUMENT: the address is malformed.
  // UNAVAILABLE: another program has the address, or this machine does not.
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
