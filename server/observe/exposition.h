#pragma once

#include <memory>
#include <string>

#include "absl/status/statusor.h"
#include "prometheus/collectable.h"

namespace prometheus {
class Exposer;
}

namespace pepeseg {

// Answers GET /metrics over plain HTTP, for Prometheus. What it tells of is read when it is asked.
class Exposition {
 public:
  // `listen`: HOST:PORT, port 0: a free one. INVALID_ARGUMENT: it is none; UNAVAILABLE: taken.
  static absl::StatusOr<std::unique_ptr<Exposition>> Start(const std::string& listen);
  // No question is under way any more when it returns.
  ~Exposition();

  // Until the object or the exposition is gone.
  void Add(const std::shared_ptr<prometheus::Collectable>& collectable);
  int port() const;

 private:
  explicit Exposition(std::unique_ptr<prometheus::Exposer> exposer);
  std::unique_ptr<prometheus::Exposer> exposer_;
};

}  // namespace pepeseg
