#pragma once

#include <memory>
#include <string>

#include "absl/status/statusor.h"
#include "prometheus/collectable.h"

namespace prometheus {
class Exposer;
}

namespace pepeseg {

// Answers GET /metrics over plain HTTP, for Prometheus. Values are read at each scrape.
class Exposition {
 public:
  // `listen`: HOST:PORT; port 0 takes a free one. INVALID_ARGUMENT: it is not HOST:PORT.
  // UNAVAILABLE: cannot listen there.
  static absl::StatusOr<std::unique_ptr<Exposition>> Start(const std::string& listen);
  // Blocks until scrapes in progress have finished.
  ~Exposition();

  // Adds an object to scrapes, until it or the exposition is destroyed.
  void Add(const std::shared_ptr<prometheus::Collectable>& collectable);
  int port() const;

 private:
  explicit Exposition(std::unique_ptr<prometheus::Exposer> exposer);
  std::unique_ptr<prometheus::Exposer> exposer_;
};

}  // namespace pepeseg
