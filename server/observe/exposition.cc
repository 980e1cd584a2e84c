#include "server/observe/exposition.h"

#include <netdb.h>
#include <prometheus/exposer.h>
#include <sys/socket.h>
#include <unistd.h>

#include <chrono>
#include <exception>
#include <thread>
#include <utility>
#include <vector>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/strip.h"

namespace pepeseg {
namespace {

// Replaces localhost by its address: the HTTP server accepts no names.
std::string AddressOf(const std::string& listen) {
  constexpr char kLocal[] = "localhost:";
  if (!absl::StartsWith(listen, kLocal)) return listen;
  return absl::StrCat("127.0.0.1:", listen.substr(sizeof(kLocal) - 1));
}

// Opens a connection to HOST:PORT without waiting for it, and closes it.
void Visit(const std::string& host, int port) {
  addrinfo hints = {}, *found = nullptr;
  hints.ai_flags = AI_NUMERICHOST | AI_NUMERICSERV;
  hints.ai_socktype = SOCK_STREAM;
  if (getaddrinfo(host.c_str(), std::to_string(port).c_str(), &hints, &found) != 0) return;
  const int socket_type = found->ai_socktype | SOCK_NONBLOCK | SOCK_CLOEXEC;
  const int visitor = socket(found->ai_family, socket_type, found->ai_protocol);
  if (visitor >= 0) {
    (void)connect(visitor, found->ai_addr, found->ai_addrlen);
    close(visitor);
  }
  freeaddrinfo(found);
}

// Returns HOST of HOST:PORT, without the brackets of an IPv6 address.
std::string HostOf(const std::string& listen) {
  absl::string_view host = absl::string_view(listen).substr(0, listen.rfind(':'));
  if (absl::ConsumePrefix(&host, "[")) absl::ConsumeSuffix(&host, "]");
  return std::string(host);
}

}  // namespace

Exposition::Exposition(std::unique_ptr<prometheus::Exposer> exposer, std::string host)
    : exposer_(std::move(exposer)), host_(std::move(host)) {}

// The HTTP server sees that it is to stop when somebody connects, or every two seconds.
Exposition::~Exposition() {
  const std::jthread visitor([host = host_, port = port()](const std::stop_token& stopped) {
    while (!stopped.stop_requested()) {
      Visit(host, port);
      std::this_thread::sleep_for(std::chrono::milliseconds(10));
    }
  });
  exposer_.reset();
}

absl::StatusOr<std::unique_ptr<Exposition>> Exposition::Start(const std::string& listen) {
  if (absl::StartsWith(listen, "unix:") || !absl::StrContains(listen, ':')) {
    return absl::InvalidArgumentError(
        absl::StrCat("metrics on ", listen, ": must be HOST:PORT, as 127.0.0.1:9464"));
  }
  // One thread answers scrapes one after the other, so a client that does not read is dropped soon:
  // it would keep Prometheus out.
  const std::string address = AddressOf(listen);
  const std::vector<std::string> options = {
      "listening_ports",    address, "num_threads",       "1",
      "request_timeout_ms", "5000",  "enable_keep_alive", "no"};
  try {
    return std::unique_ptr<Exposition>(
        new Exposition(std::make_unique<prometheus::Exposer>(options), HostOf(address)));
  } catch (const std::exception& error) {
    return absl::UnavailableError(
        absl::StrCat("cannot listen on ", listen, " for metrics: ", error.what()));
  }
}

void Exposition::Add(const std::shared_ptr<prometheus::Collectable>& collectable) {
  exposer_->RegisterCollectable(collectable);
}

int Exposition::port() const {
  const std::vector<int> ports = exposer_->GetListeningPorts();
  return ports.empty() ? 0 : ports.front();
}

}  // namespace pepeseg
