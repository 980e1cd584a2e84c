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

// Metrics of the jobs that run on this server, from their events. A job's series exist only while
// it runs, so that their number stays small. Thread safe.
class JobMetrics final : public prometheus::Collectable {
 public:
  JobMetrics();

  // Records an event that a job's worker, or the supervisor, has just written.
  void Observe(const std::string& job, const v1::JobEvent& event);

  // Sets how to find out whether a job still runs here: a job that another server has taken over
  // ends here without an event. Call it before the first scrape.
  void SetRunning(std::function<bool(const std::string& job)> is_running) {
    is_running_ = std::move(is_running);
  }

  std::vector<prometheus::MetricFamily> Collect() const override;

 private:
  prometheus::Family<prometheus::Histogram> stage_seconds_;
  std::function<bool(const std::string&)> is_running_;       // empty: all jobs run here
  mutable std::mutex mutex_;                                 // guards progress_
  mutable std::map<std::string, v1::JobProgress> progress_;  // the newest of each job
};

}  // namespace pepeseg
