#include "tests/system/stress/residency.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <fstream>
#include <map>
#include <mutex>
#include <random>
#include <thread>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/time/clock.h"
#include "server/residency/memory_budget.h"
#include "tests/server/running_server.h"

namespace pepeseg {
namespace {

constexpr int kNumQueries = 6;  // queries of a model

int64_t Rss() {
  std::ifstream file("/proc/self/statm");
  int64_t size = 0, resident = 0;
  file >> size >> resident;
  return resident * sysconf(_SC_PAGESIZE);
}

std::string ModelName(int model) { return absl::StrCat("scenes/m", model, "/models/1"); }

v1::SegmentViewsRequest QueryOf(int model, int query) {
  v1::SegmentViewsRequest request;
  request.set_model(ModelName(model));
  request.mutable_prompt()->mutable_view()->set_view("middle.jpg");
  auto& point = *request.mutable_prompt()->mutable_points()->add_points();
  point.set_x(query % 2 == 0 ? 39 : 75);  // a point inside a square of every model
  point.set_y(32);
  request.mutable_granularity()->set_scale_quantile(0.5);
  request.mutable_granularity()->set_threshold(query < 2 ? 0.75 : 0.5);
  if (query >= 4) {
    request.mutable_targets()->set_group(v1::SegmentViewsRequest::Targets::GROUP_HELD_OUT);
  }
  return request;
}

class ResidencyStress {
 public:
  explicit ResidencyStress(const ResidencyStressSettings& settings)
      : settings_(settings), running_(settings.worker, RoomForAll()) {}

  ResidencyStressReport Run() {
    MakeModels();
    RecordAnswers();
    running_.options.model_bytes = BudgetFor(settings_.num_resident);
    running_.Restart();
    AskAtOnce();
    UnloadAll();
    report_.rss_before = Rss();
    AskForLong();
    UnloadAll();
    report_.rss_after = Rss();
    const v1::ListResidentModelsResponse last = List();
    report_.left_reserved = last.host().reserved_bytes();
    report_.left_in_use = last.device_bytes_in_use();
    report_.num_loads = last.num_loads();
    report_.num_evictions = last.num_evictions();
    return report_;
  }

 private:
  static ServerOptions RoomForAll() {
    ServerOptions options;
    options.admin = "127.0.0.1:0";
    options.model_bytes = int64_t{1} << 40;
    return options;
  }
  // Plus the 5 % that stay free, and half a model.
  static int64_t BudgetFor(int num_models) {
    const MemoryBytes one = BytesOfModel(*MakeCpuBackend(1), {20'000, 0, int64_t{96} * 64});
    return (one.host + one.device) * (2 * num_models + 1) / 2 * 20 / 19;
  }

  void MakeModels();
  void RecordAnswers();
  void AskAtOnce();
  void AskForLong();
  void AskUntil(absl::Time end, int thread);
  void Operate(absl::Time end);
  void SampleUntil(absl::Time end);
  void UnloadAll();
  std::vector<std::string> Ask(int model, int query);
  v1::ListResidentModelsResponse List();
  void CountError(const grpc::Status& status);

  const ResidencyStressSettings settings_;
  RunningServer running_;
  std::map<std::pair<int, int>, std::vector<std::string>> want_;  // by model and query
  std::mutex mutex_;                                              // guards the report
  ResidencyStressReport report_;
};

void ResidencyStress::MakeModels() {
  for (int model = 0; model < settings_.num_models; ++model) {
    const std::string scene = absl::StrCat("m", model);
    running_.CreateScene(scene);
    const v1::Job job = running_.Await(running_.Train(scene, absl::StrCat(model, ".model")).name());
    EXPECT_EQ(job.state(), v1::JOB_STATE_SUCCEEDED) << job.DebugString();
  }
}

// Records the answers of each model alone in memory.
void ResidencyStress::RecordAnswers() {
  for (int model = 0; model < settings_.num_models; ++model) {
    for (int query = 0; query < kNumQueries; ++query) {
      want_[{model, query}] = Ask(model, query);
    }
    UnloadAll();
  }
  EXPECT_NE((want_[{0, 0}]), (want_[{1, 0}])) << "the models do not differ";
  EXPECT_EQ(report_.num_failed, 0) << report_.first_error;
}

std::vector<std::string> ResidencyStress::Ask(int model, int query) {
  grpc::ClientContext context;
  v1::SegmentViewsResponse response;
  const grpc::Status status =
      running_.segmentation->SegmentViews(&context, QueryOf(model, query), &response);
  std::vector<std::string> masks;
  masks.reserve(response.masks_size());
  for (const v1::SegmentViewsResponse::ViewMask& mask : response.masks())
    masks.push_back(mask.rle().counts());
  if (!status.ok()) CountError(status);
  return masks;
}

void ResidencyStress::CountError(const grpc::Status& status) {
  const std::lock_guard lock(mutex_);
  ++report_.num_failed;
  if (report_.first_error.empty()) {
    report_.first_error = absl::StrCat(status.error_code(), " ", status.error_message());
  }
}

v1::ListResidentModelsResponse ResidencyStress::List() {
  const auto reply = running_.Call(&AdminStub::ListResidentModels, {});
  if (!reply.ok()) CountError(reply);
  return reply.ok() ? *reply : v1::ListResidentModelsResponse();
}

void ResidencyStress::UnloadAll() {
  const v1::ListResidentModelsResponse list = List();
  for (const v1::ResidentModel& model : list.models()) {
    running_.Call(&AdminStub::UnpinModel, Named{model.name()});
    const grpc::Status status = running_.Call(&AdminStub::UnloadModel, Named{model.name()});
    if (!status.ok()) CountError(status);
  }
}

void ResidencyStress::AskAtOnce() {
  const int64_t before = List().num_loads();
  std::atomic<int> num_wrong = 0;
  std::vector<std::thread> threads;
  threads.reserve(kNumFirstQueries);
  for (int i = 0; i < kNumFirstQueries; ++i) {
    threads.emplace_back([&] { num_wrong += Ask(0, 0) != want_.at({0, 0}) ? 1 : 0; });
  }
  for (std::thread& thread : threads) thread.join();
  report_.num_wrong += num_wrong;
  report_.loads_of_first_queries = List().num_loads() - before;
}

void ResidencyStress::AskForLong() {
  const absl::Time end = absl::Now() + settings_.duration;
  std::vector<std::thread> threads;
  threads.reserve(settings_.num_threads + 2);
  for (int i = 0; i < settings_.num_threads; ++i) {
    threads.emplace_back([this, end, i] { AskUntil(end, i); });
  }
  threads.emplace_back([this, end] { Operate(end); });
  threads.emplace_back([this, end] { SampleUntil(end); });
  for (std::thread& thread : threads) thread.join();
}

void ResidencyStress::AskUntil(absl::Time end, int thread) {
  std::mt19937 engine(thread);
  int64_t num_queries = 0, num_wrong = 0;
  while (absl::Now() < end) {
    const int model = static_cast<int>(engine() % settings_.num_models);
    const int query = static_cast<int>(engine() % kNumQueries);
    num_wrong += Ask(model, query) != want_.at({model, query}) ? 1 : 0;
    ++num_queries;
  }
  const std::lock_guard lock(mutex_);
  report_.num_queries += num_queries;
  report_.num_wrong += num_wrong;
}

// Ignores errors: a model that is to be unloaded may just have been evicted.
void ResidencyStress::Operate(absl::Time end) {
  std::mt19937 engine(1000);
  for (int round = 0; absl::Now() < end; ++round) {
    const std::string name = ModelName(static_cast<int>(engine() % settings_.num_models));
    running_.Call(&AdminStub::PinModel, Named{name});
    running_.Call(&AdminStub::UnloadModel,
                  Named{ModelName(static_cast<int>(engine() % settings_.num_models))});
    absl::SleepFor(absl::Milliseconds(100));
    running_.Call(&AdminStub::UnpinModel, Named{name});
  }
}

void ResidencyStress::SampleUntil(absl::Time end) {
  while (absl::Now() < end) {
    absl::SleepFor(absl::Milliseconds(2));  // leaves the CPU to the queries
    const v1::ListResidentModelsResponse now = List();
    const int64_t rss = Rss();
    const std::lock_guard lock(mutex_);
    ++report_.num_samples;
    report_.limit = now.host().limit_bytes();
    report_.peak_reserved = std::max(report_.peak_reserved, now.host().reserved_bytes());
    report_.peak_in_use = std::max(report_.peak_in_use, now.device_bytes_in_use());
    report_.rss_peak = std::max(report_.rss_peak, rss);
    int64_t of_models = 0;
    for (const auto& model : now.models()) of_models += model.host_bytes() + model.device_bytes();
    report_.peak_reserved = std::max(report_.peak_reserved, of_models);
  }
}

}  // namespace

std::string ResidencyStressReport::ToString() const {
  const auto mib = [](int64_t bytes) { return static_cast<double>(bytes) / (1 << 20); };
  return absl::StrFormat(
      "%d queries, %d wrong, %d failed %s\n%d loads, %d evictions, %d load by %d first queries\n"
      "reserved at most %.1f of %.1f MiB, of the device in use at most %.1f MiB, %d samples\n"
      "left: %d bytes reserved, %d in use\n"
      "resident set: %.1f MiB before, %.1f at most, %.1f after\n",
      num_queries, num_wrong, num_failed, first_error, num_loads, num_evictions,
      loads_of_first_queries, kNumFirstQueries, mib(peak_reserved), mib(limit), mib(peak_in_use),
      num_samples, left_reserved, left_in_use, mib(rss_before), mib(rss_peak), mib(rss_after));
}

ResidencyStressReport RunResidencyStress(const ResidencyStressSettings& settings) {
  return ResidencyStress(settings).Run();
}

}  // namespace pepeseg
