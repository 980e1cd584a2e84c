#include "server/observe/exposition.h"

#include <prometheus/exposer.h>

#include <exception>
#include <utility>
#include <vector>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"

namespace pepeseg {
namespace {

// Replaces localhost by its address: the HTTP server accepts no names.
std::string AddressOf(const std::string& listen) {
  constexpr char kLocal[] = "localhost:";
  if (!absl::StartsWith(listen, kLocal)) return listen;
  return absl::StrCat("127.0.0.1:", listen.substr(sizeof(kLocal) - 1));
}

}  // namespace

Exposition::Exposition(std::unique_ptr<prometheus::Exposer> exposer)
    : exposer_(std::move(exposer)) {}
Exposition::~Exposition() = default;

absl::StatusOr<std::unique_ptr<Exposition>> Exposition::Start(const std::string& listen) {
  if (absl::StartsWith(listen, "unix:") || !absl::StrContains(listen, ':')) {
    return absl::InvalidArgumentError(
        absl::StrCat("metrics on ", listen, ": must be HOST:PORT, as 127.0.0.1:9464"));
  }
  // One thread answers scrapes one after the other, so a client that does not read is dropped soon:
  // it would keep Prometheus out.
  const std::vector<std::string> options = {"listening_ports",    AddressOf(listen),
                                            "num_threads",        "1",
                                            "request_timeout_ms", "5000",
                                            "enable_keep_alive",  "no"};
  try {
    return std::unique_ptr<Exposition>(
        new Exposition(std::make_unique<prometheus::Exposer>(options)));
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
