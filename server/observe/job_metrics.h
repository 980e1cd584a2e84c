#pragma once

#include <prometheus/family.h>
#include <prometheus/histogram.h>

#include <functional>
#include <map>
#include <mutex>
#include <string>
#include <utility>
#include <vector>

#include "pepeseg/v1/job_service.pb.h"

namespace pepeseg {

// How the jobs that run here get on, from their events. A job's series are there while it runs, so
// that there are never many. Thread safe.
class JobMetrics final : public prometheus::Collectable {
 public:
  JobMetrics();

  // An event that a job's worker, or the supervisor, has just written.
  void Observe(const std::string& job, const v1::JobEvent& event);

  // Whether a job still runs here: one that another server has taken over ends without an event.
  void SetRunning(std::function<bool(const std::string& job)> is_running) {
    is_running_ = std::move(is_running);
  }

  std::vector<prometheus::MetricFamily> Collect() const override;

 private:
  prometheus::Family<prometheus::Histogram> stage_seconds_;
  std::function<bool(const std::string&)> is_running_;  // empty: all do
  mutable std::mutex mutex_;
  mutable std::map<std::string, v1::JobProgress> progress_;  // the newest, by job
};

}  // namespace pepeseg
