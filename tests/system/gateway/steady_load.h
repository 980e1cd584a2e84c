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
  int64_t num_retried = 0;             // failed at first
  int64_t num_failed = 0;              // and the second time, too
  std::map<std::string, int> reasons;  // of both
  absl::Duration took, p50, p99, longest;
  double per_second() const { return static_cast<double>(num_calls) / absl::ToDoubleSeconds(took); }
};

// The same question to each scene by turns, so many a second whatever becomes of them, from its
// start to Stop(). A call that fails is made a second time, once.
class SteadyLoad {
 public:
  // `channels` are used by turns, with scenes "s0" to "s<num_scenes - 1>" that have a model.
  SteadyLoad(std::vector<std::shared_ptr<grpc::Channel>> channels, int num_scenes,
             double per_second);
  ~SteadyLoad() { Stop(); }
  SteadyLoad(const SteadyLoad&) = delete;
  SteadyLoad& operator=(const SteadyLoad&) = delete;

  SteadyLoadReport Stop();

  static std::string SceneId(int i) { return "s" + std::to_string(i); }
  // Of the view that model_worker.cc's models have: a click on the red square.
  static v1::SegmentRequest Question(const std::string& scene);

 private:
  struct Call;
  void Run(int num_scenes, absl::Duration pause);
  void Start(std::shared_ptr<Call> call);
  void Answered(const std::shared_ptr<Call>& call, const grpc::Status& status);

  std::vector<std::unique_ptr<v1::SegmentationService::Stub>> stubs_;
  std::atomic<bool> stopping_ = false;
  std::atomic<int64_t> num_open_ = 0;
  std::mutex mutex_;  // guards what follows
  SteadyLoadReport report_;
  std::vector<absl::Duration> durations_;
  std::thread thread_;
};

}  // namespace pepeseg::testing
