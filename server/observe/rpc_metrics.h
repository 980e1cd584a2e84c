#pragma once

#include <prometheus/counter.h>
#include <prometheus/family.h>
#include <prometheus/histogram.h>

#include <array>
#include <atomic>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <unordered_map>
#include <vector>

#include "absl/time/time.h"

namespace pepeseg {

// Calls by method and code. Only methods that a descriptor knows have a label of their own, so that
// no client can make more series than there are methods. Thread safe.
class RpcMetrics final : public prometheus::Collectable {
 public:
  struct Method;

  // Of these services, as "pepeseg.v1.SceneService"; linked into the program.
  explicit RpcMetrics(std::span<const std::string> services);
  ~RpcMetrics() override;

  // Of a path as "/pepeseg.v1.SceneService/GetScene"; that of all others where it is unknown.
  Method& Find(std::string_view path);
  static const std::string& NameOf(const Method& method);  // "SceneService/GetScene"

  // A call has come; its status is sent; it is gone, whether or not one was.
  void Begin(const Method& method);
  void Answer(Method& method, int grpc_code, absl::Duration took);
  void End(const Method& method);
  // Of methods that have a name here: those of others, as health's, may last for ever.
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

// "NOT_FOUND", or "CODE_42".
std::string CodeName(int grpc_code);

}  // namespace pepeseg
