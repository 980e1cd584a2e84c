#pragma once

#include <grpcpp/grpcpp.h>

#include <atomic>
#include <cstdint>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "absl/time/time.h"
#include "pepeseg/v1/segmentation_service.grpc.pb.h"

namespace pepeseg::testing {

struct SteadyLoadReport {
  int64_t num_calls = 0;
  int64_t num_retried = 0;             // calls that failed the first time
  int64_t num_failed = 0;              // calls that also failed the second time
  std::map<std::string, int> reasons;  // of all failures
  absl::Duration took, p50, p99, longest;
  double per_second() const { return static_cast<double>(num_calls) / absl::ToDoubleSeconds(took); }
};

// Sends the same query to each scene in turn, at a fixed rate that does not depend on the answers,
// from its construction to Stop(). A call that fails is repeated once.
class SteadyLoad {
 public:
  // Uses `channels` in turn. The scenes "s0" to "s<num_scenes - 1>" must have a model.
  SteadyLoad(std::vector<std::shared_ptr<grpc::Channel>> channels, int num_scenes,
             double per_second);
  ~SteadyLoad() { Stop(); }
  SteadyLoad(const SteadyLoad&) = delete;
  SteadyLoad& operator=(const SteadyLoad&) = delete;

  SteadyLoadReport Stop();

  static std::string SceneId(int i) { return "s" + std::to_string(i); }
  // Returns a click on the red square of model_worker.cc's models.
  static v1::SegmentViewsRequest SmallQuery(const std::string& scene);

 private:
  struct Call;
  void Run(int num_scenes, absl::Duration pause);
  void Start(std::shared_ptr<Call> call);
  void Answered(const std::shared_ptr<Call>& call, const grpc::Status& status);

  std::vector<std::unique_ptr<v1::SegmentationService::Stub>> stubs_;
  std::atomic<bool> stopping_ = false;
  std::atomic<int64_t> num_open_ = 0;
  std::mutex mutex_;  // guards the members below
  SteadyLoadReport report_;
  std::vector<absl::Duration> durations_;
  std::thread thread_;
};

}  // namespace pepeseg::testing
