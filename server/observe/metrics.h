#pragma once

#include <prometheus/counter.h>
#include <prometheus/family.h>
#include <prometheus/histogram.h>

#include <array>
#include <atomic>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <span>
#include <string>
#include <string_view>
#include <unordered_map>
#include <utility>
#include <vector>

#include "absl/time/time.h"
#include "pepeseg/v1/job_service.pb.h"

// Metrics that are counted as calls and jobs proceed. The others are read at each scrape
// (server_metrics.h).
namespace pepeseg {

// Metrics of calls by method and code. Only methods of the contract have a label of their own;
// others share one, so that clients cannot create series. Thread safe.
class RpcMetrics final : public prometheus::Collectable {
 public:
  struct Method;

  // `services`: full names, as "pepeseg.v1.SceneService"; their descriptors must be linked into the
  // program.
  explicit RpcMetrics(std::span<const std::string> services);
  ~RpcMetrics() override;

  // Returns the method of a path such as "/pepeseg.v1.SceneService/GetScene", or the one that all
  // unknown paths share.
  Method& Find(std::string_view path);
  static const std::string& NameOf(const Method& method);  // "SceneService/GetScene"

  // Record that a call has arrived, that its status was sent, and that it has ended, with or
  // without a status.
  void Begin(const Method& method);
  void Answer(Method& method, int grpc_code, absl::Duration took);
  void End(const Method& method);
  // Returns the calls in flight of known methods. Calls of others, such as health watches, may last
  // for ever.
  int64_t num_named_in_flight() const { return num_named_in_flight_; }

  std::vector<prometheus::MetricFamily> Collect() const override;

 private:
  std::unique_ptr<Method> MakeMethod(const std::string& name);
  prometheus::Counter& CounterOf(Method& method, int grpc_code);

  prometheus::Family<prometheus::Counter> calls_;
  prometheus::Family<prometheus::Histogram> seconds_;
  std::atomic<int64_t> num_in_flight_ = 0, num_named_in_flight_ = 0;
  std::unordered_map<std::string_view, std::unique_ptr<Method>> methods_;  // by path
  std::vector<std::unique_ptr<const std::string>> paths_;
  std::unique_ptr<Method> other_;
};

// Returns the name of a gRPC status code, as "NOT_FOUND"; "CODE_42" for an unknown one.
std::string CodeName(int grpc_code);

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
