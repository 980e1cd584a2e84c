#pragma once

#include "absl/time/clock.h"
#include "absl/time/time.h"

namespace pepeseg {

// Time since the lap before.
class Stopwatch {
 public:
  absl::Duration Lap() {
    const absl::Time now = absl::Now();
    const absl::Duration lap = now - start_;
    start_ = now;
    return lap;
  }

 private:
  absl::Time start_ = absl::Now();
};

}  // namespace pepeseg
