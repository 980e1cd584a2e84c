#pragma once

#include <prometheus/metric_family.h>

#include <string>
#include <utility>
#include <vector>

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

}  // namespace pepeseg
