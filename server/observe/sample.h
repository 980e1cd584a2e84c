#pragma once

#include <prometheus/metric_family.h>

#include <string>
#include <utility>
#include <vector>

namespace pepeseg {

using MetricLabels = std::vector<prometheus::ClientMetric::Label>;

// Families of values that are read when somebody scrapes, one after the other.
class Samples {
 public:
  explicit Samples(std::vector<prometheus::MetricFamily>& families) : families_(families) {}

  // Begins a family. `name` and `help` as Prometheus recommends them; a counter ends in "_total".
  void Gauge(const char* name, const char* help) {
    Begin(name, help, prometheus::MetricType::Gauge);
  }
  void Counter(const char* name, const char* help) {
    Begin(name, help, prometheus::MetricType::Counter);
  }
  // A sample of the family begun last.
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
