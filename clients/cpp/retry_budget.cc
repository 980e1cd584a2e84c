#include "clients/cpp/retry_budget.h"

#include <algorithm>
#include <optional>
#include <thread>

#include "clients/cpp/answer_status.h"

namespace pepeseg::client {
namespace {

constexpr double kLongest = 120;

std::chrono::nanoseconds FromSeconds(double seconds) {
  return std::chrono::duration_cast<std::chrono::nanoseconds>(
      std::chrono::duration<double>(seconds));
}

std::optional<std::chrono::nanoseconds> RetryAfter(const absl::Status& status) {
  const std::optional<v1::ErrorDetail> detail = DetailOf(status);
  if (!absl::IsUnavailable(status) || !detail || !detail->has_retry_after()) return std::nullopt;
  if (detail->reason() == "DRAINING") return std::nullopt;
  const std::chrono::nanoseconds wait = std::chrono::seconds(detail->retry_after().seconds()) +
                                        std::chrono::nanoseconds(detail->retry_after().nanos());
  return std::max<std::chrono::nanoseconds>(wait, std::chrono::milliseconds(1));
}

}  // namespace

RetryBudget::RetryBudget(double seconds)
    : has_deadline_(seconds > 0),
      end_(Clock::now() + FromSeconds(has_deadline_ ? seconds : kLongest)) {}

double RetryBudget::seconds_left() const {
  if (!has_deadline_) return 0;
  return std::max(1e-3, std::chrono::duration<double>(end_ - Clock::now()).count());
}

bool RetryBudget::WaitAfter(const absl::Status& status) const {
  const std::optional<std::chrono::nanoseconds> wait = RetryAfter(status);
  if (!wait || Clock::now() + *wait >= end_) return false;
  std::this_thread::sleep_for(*wait);
  return true;
}

}  // namespace pepeseg::client
