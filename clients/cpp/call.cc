#include "clients/cpp/call.h"

#include <algorithm>
#include <cstdint>
#include <optional>
#include <thread>

namespace pepeseg::client {
namespace {

constexpr double kMaxRetrySeconds = 120;  // of calls without a deadline

std::chrono::nanoseconds FromSeconds(double seconds) {
  return std::chrono::duration_cast<std::chrono::nanoseconds>(
      std::chrono::duration<double>(seconds));
}

// Returns the time to wait before the call is repeated; nothing if it must not be.
std::optional<std::chrono::nanoseconds> RetryAfter(const absl::Status& status) {
  const std::optional<ErrorDetail> detail = DetailOf(status);
  if (!absl::IsUnavailable(status) || !detail || !detail->retry_after) return std::nullopt;
  // A server that shuts down takes no further calls.
  if (detail->reason == "DRAINING") return std::nullopt;
  const std::chrono::nanoseconds wait = absl::ToChronoNanoseconds(*detail->retry_after);
  // A wait of 0 would repeat the call in a busy loop.
  return std::max<std::chrono::nanoseconds>(wait, std::chrono::milliseconds(1));
}

}  // namespace

Call::Call(const std::string& scene, double seconds) {
  const std::string name = SceneName(scene);
  // The id alone, by which proxies can route calls of one scene to one server.
  if (!scene.empty()) context_.AddMetadata("x-scene", name.substr(name.rfind('/') + 1));
  if (seconds > 0) {
    context_.set_deadline(std::chrono::system_clock::now() +
                          std::chrono::milliseconds(static_cast<int64_t>(seconds * 1000)));
  }
}

RetryBudget::RetryBudget(double seconds)
    : has_deadline_(seconds > 0),
      end_(Clock::now() + FromSeconds(has_deadline_ ? seconds : kMaxRetrySeconds)) {}

double RetryBudget::seconds_left() const {
  if (!has_deadline_) return 0;
  // Never 0, which stands for no deadline.
  return std::max(1e-3, std::chrono::duration<double>(end_ - Clock::now()).count());
}

bool RetryBudget::WaitAfter(const absl::Status& status) const {
  const std::optional<std::chrono::nanoseconds> wait = RetryAfter(status);
  if (!wait || Clock::now() + *wait >= end_) return false;
  std::this_thread::sleep_for(*wait);
  return true;
}

}  // namespace pepeseg::client
