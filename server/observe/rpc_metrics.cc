#include "server/observe/rpc_metrics.h"

#include <google/protobuf/descriptor.h>

#include "absl/status/status.h"
#include "absl/strings/str_cat.h"
#include "server/observe/exposition.h"

namespace pepeseg {
namespace {

constexpr int kNumCodes = 17;  // of gRPC: 0 is OK, 16 UNAUTHENTICATED
constexpr char kCallsName[] = "pepeseg_rpc_calls_total";
constexpr char kCallsHelp[] = "Calls answered, by method and code.";
constexpr char kSecondsName[] = "pepeseg_rpc_duration_seconds";
constexpr char kSecondsHelp[] = "From a call's arrival to its status; of streams their whole life.";
const prometheus::Histogram::BucketBoundaries kBounds = {
    0.001, 0.0025, 0.005, 0.01, 0.025, 0.05, 0.1, 0.25, 0.5, 1, 2.5, 5, 10, 30, 60, 300};

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
  method->seconds = &seconds_.Add({{"method", name}}, kBounds);
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

}  // namespace pepeseg
