#pragma once

#include <algorithm>

#include "absl/time/clock.h"
#include "absl/time/time.h"

namespace pepeseg {

// Pauses between the tries of something that keeps failing: 1 s after the first failure, twice as
// long after each further one, at most 10 s. Not thread safe.
class RetryPause {
 public:
  void Fail() {
    ++num_failures_;
    last_failure_ = absl::Now();
    length_ = std::clamp(2 * length_, absl::Seconds(1), absl::Seconds(10));
  }
  void Succeed() { *this = RetryPause(); }

  // Failures in a row.
  int num_failures() const { return num_failures_; }
  // Whether the next try is due; `longest` shortens the pause.
  bool Over(absl::Duration longest = absl::InfiniteDuration()) const {
    return absl::Now() >= last_failure_ + std::min(length_, longest);
  }

 private:
  int num_failures_ = 0;
  absl::Duration length_ = absl::ZeroDuration();
  absl::Time last_failure_ = absl::InfinitePast();
};

}  // namespace pepeseg
