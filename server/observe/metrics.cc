#include "server/observe/metrics.h"

#include <google/protobuf/descriptor.h>

#include "absl/status/status.h"
#include "absl/strings/str_cat.h"
#include "server/observe/exposition.h"
#include "server/worker_protocol/job_stage.h"

namespace pepeseg {
namespace {

constexpr int kNumCodes = 17;  // of gRPC: 0 is OK, 16 UNAUTHENTICATED
constexpr char kCallsName[] = "pepeseg_rpc_calls_total";
constexpr char kCallsHelp[] = "Calls answered, by method and code.";
constexpr char kSecondsName[] = "pepeseg_rpc_duration_seconds";
constexpr char kSecondsHelp[] = "From a call's arrival to its status; of streams their whole life.";
const prometheus::Histogram::BucketBoundaries kCallBounds = {
    0.001, 0.0025, 0.005, 0.01, 0.025, 0.05, 0.1, 0.25, 0.5, 1, 2.5, 5, 10, 30, 60, 300};

constexpr char kStageName[] = "pepeseg_job_stage_duration_seconds";
constexpr char kStageHelp[] = "What the stages of jobs took.";
const prometheus::Histogram::BucketBoundaries kStageBounds = {1,   5,    15,   60,   300,
                                                              900, 1800, 3600, 7200, 21600};

// Returns the label `stage`; one for all unknown numbers, so that a worker cannot create arbitrary
// series.
std::string StageLabel(v1::JobStage stage) {
  const std::string name = NameOfStage(stage);
  return name.empty() ? "other" : name;
}

}  // namespace

struct RpcMetrics::Method {
  std::string name;
  prometheus::Histogram* seconds = nullptr;
  // Null until the first call that ends with the code.
  std::array<std::atomic<prometheus::Counter*>, kNumCodes> calls{};
};

std::string CodeName(int grpc_code) {
  if (grpc_code < 0 || grpc_code >= kNumCodes) return absl::StrCat("CODE_", grpc_code);
  return absl::StatusCodeToString(static_cast<absl::StatusCode>(grpc_code));
}

RpcMetrics::RpcMetrics(std::span<const std::string> services)
    : calls_(kCallsName, kCallsHelp, {}),
      seconds_(kSecondsName, kSecondsHelp, {}),
      other_(MakeMethod("other")) {
  for (const std::string& name : services) {
    const auto* service =
        google::protobuf::DescriptorPool::generated_pool()->FindServiceByName(name);
    for (int i = 0; service != nullptr && i < service->method_count(); ++i) {
      const std::string& method = service->method(i)->name();
      paths_.push_back(std::make_unique<std::string>(absl::StrCat("/", name, "/", method)));
      methods_[*paths_.back()] = MakeMethod(absl::StrCat(service->name(), "/", method));
    }
  }
}

RpcMetrics::~RpcMetrics() = default;

std::unique_ptr<RpcMetrics::Method> RpcMetrics::MakeMethod(const std::string& name) {
  auto method = std::make_unique<Method>();
  method->name = name;
  method->seconds = &seconds_.Add({{"method", name}}, kCallBounds);
  return method;
}

RpcMetrics::Method& RpcMetrics::Find(std::string_view path) {
  const auto found = methods_.find(path);
  return found == methods_.end() ? *other_ : *found->second;
}

const std::string& RpcMetrics::NameOf(const Method& method) { return method.name; }

void RpcMetrics::Begin(const Method& method) {
  ++num_in_flight_;
  if (&method != other_.get()) ++num_named_in_flight_;
}

void RpcMetrics::End(const Method& method) {
  --num_in_flight_;
  if (&method != other_.get()) --num_named_in_flight_;
}

void RpcMetrics::Answer(Method& method, int grpc_code, absl::Duration took) {
  CounterOf(method, grpc_code).Increment();
  method.seconds->Observe(absl::ToDoubleSeconds(took));
}

// Caches the counter of each method and code in an atomic pointer: Add takes the family's lock and
// hashes the labels. Release and acquire order make the counter visible with its pointer.
prometheus::Counter& RpcMetrics::CounterOf(Method& method, int grpc_code) {
  constexpr int kUnknown = 2;
  const int code = grpc_code < 0 || grpc_code >= kNumCodes ? kUnknown : grpc_code;
  prometheus::Counter* counter = method.calls[code].load(std::memory_order_acquire);
  if (counter != nullptr) return *counter;
  // Add returns the same counter to all threads that get here at the same time.
  counter = &calls_.Add({{"method", method.name}, {"code", CodeName(code)}});
  method.calls[code].store(counter, std::memory_order_release);
  return *counter;
}

std::vector<prometheus::MetricFamily> RpcMetrics::Collect() const {
  std::vector<prometheus::MetricFamily> families = calls_.Collect();
  if (families.empty()) {
    families.push_back({kCallsName, kCallsHelp, prometheus::MetricType::Counter, {}});
  }
  for (prometheus::MetricFamily& family : seconds_.Collect()) families.push_back(std::move(family));
  Samples samples(families);
  samples.Gauge("pepeseg_rpc_calls_in_flight", "Calls under way, streams with them.");
  samples.Add(static_cast<double>(num_in_flight_));
  return families;
}

JobMetrics::JobMetrics() : stage_seconds_(kStageName, kStageHelp, {}) {}

void JobMetrics::Observe(const std::string& job, const v1::JobEvent& event) {
  if (event.has_stage_ended() && event.stage_ended().skipped().empty()) {
    const auto& elapsed = event.stage_ended().elapsed();
    stage_seconds_.Add({{"stage", StageLabel(event.stage_ended().stage())}}, kStageBounds)
        .Observe(static_cast<double>(elapsed.seconds()) + elapsed.nanos() * 1e-9);
  }
  const std::lock_guard lock(mutex_);
  if (event.has_progress()) progress_[job] = event.progress();
  if (event.has_state_changed() && event.state_changed().state() != v1::JOB_STATE_RUNNING) {
    progress_.erase(job);
  }
}

std::vector<prometheus::MetricFamily> JobMetrics::Collect() const {
  std::vector<prometheus::MetricFamily> families = stage_seconds_.Collect();
  if (families.empty()) {
    families.push_back({kStageName, kStageHelp, prometheus::MetricType::Histogram, {}});
  }
  std::map<std::string, v1::JobProgress> running;
  {
    const std::lock_guard lock(mutex_);
    std::erase_if(progress_,
                  [&](const auto& entry) { return is_running_ && !is_running_(entry.first); });
    running = progress_;
  }
  Samples samples(families);
  const auto add = [&](const char* name, const char* help, auto value) {
    samples.Gauge(name, help);
    for (const auto& [job, progress] : running) {
      samples.Add(static_cast<double>(value(progress)),
                  {{"job", job}, {"stage", StageLabel(progress.stage())}});
    }
  };
  using Progress = v1::JobProgress;
  add("pepeseg_job_steps_per_second", "Pace of a job's stage.",
      [](const Progress& progress) { return progress.steps_per_second(); });
  add("pepeseg_job_psnr_decibels", "PSNR of its newest training views.",
      [](const Progress& progress) { return progress.psnr(); });
  add("pepeseg_job_gaussians", "Gaussians that it has.",
      [](const Progress& progress) { return progress.num_gaussians(); });
  add("pepeseg_job_done_ratio", "Steps done of those of its stage.", [](const Progress& progress) {
    return progress.num_steps() == 0
               ? 0.0
               : static_cast<double>(progress.step()) / static_cast<double>(progress.num_steps());
  });
  add("pepeseg_job_worker_resident_bytes", "Memory of its worker.",
      [](const Progress& progress) { return progress.memory_bytes(); });
  return families;
}

}  // namespace pepeseg
