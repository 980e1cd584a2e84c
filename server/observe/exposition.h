#pragma once

#include <prometheus/collectable.h>
#include <prometheus/metric_family.h>

#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "absl/status/statusor.h"

namespace prometheus {
class Exposer;
}

// Metrics for Prometheus: families of samples, and the port that answers its scrapes.
namespace pepeseg {

using MetricLabels = std::vector<prometheus::ClientMetric::Label>;

// Builds metric families whose values are read at each scrape, one family after the other.
class Samples {
 public:
  explicit Samples(std::vector<prometheus::MetricFamily>& families) : families_(families) {}

  // Begin a family. Names follow Prometheus's conventions; a counter's ends in "_total".
  void Gauge(const char* name, const char* help) {
    Begin(name, help, prometheus::MetricType::Gauge);
  }
  void Counter(const char* name, const char* help) {
    Begin(name, help, prometheus::MetricType::Counter);
  }
  // Adds a sample to the family that was begun last.
  void Add(double value, MetricLabels labels = {}) {
    prometheus::ClientMetric metric;
    metric.label = std::move(labels);
    if (families_.back().type == prometheus::MetricType::Counter) {
      metric.counter.value = value;
    } else {
      metric.gauge.value = value;
    }
    families_.back().metric.push_back(std::move(metric));
  }

 private:
  void Begin(const char* name, const char* help, prometheus::MetricType type) {
    families_.push_back({name, help, type, {}});
  }

  std::vector<prometheus::MetricFamily>& families_;
};

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
  Exposition(std::unique_ptr<prometheus::Exposer> exposer, std::string host);

  std::unique_ptr<prometheus::Exposer> exposer_;
  const std::string host_;  // numeric
};

}  // namespace pepeseg
