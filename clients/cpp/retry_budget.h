#pragma once

#include <chrono>

#include "absl/status/status.h"

namespace pepeseg::client {

// How long a call is made again that the server has put off: that has answered UNAVAILABLE with
// ErrorDetail.retry_after, so that it has done nothing yet (too many calls are waiting, a model has
// no room until others were answered, the database is away). One that is stopping is not waited
// for.
class RetryBudget {
 public:
  // For all tries together; 0: two minutes.
  explicit RetryBudget(double seconds);

  // Until the end, at least a millisecond; 0 where the calls have no deadline.
  double seconds_left() const;
  // Sleeps as long as the server says; false, at once: the call is not to be made again.
  bool WaitAfter(const absl::Status& status) const;

 private:
  using Clock = std::chrono::steady_clock;
  const bool has_deadline_;
  const Clock::time_point end_;
};

}  // namespace pepeseg::client
