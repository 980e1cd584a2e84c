#pragma once

#include <condition_variable>
#include <functional>
#include <mutex>
#include <thread>

#include "absl/status/status.h"
#include "absl/time/time.h"

namespace pepeseg {

// Checks periodically whether the server can be reached, and reports once when it cannot.
class SelfProbe {
 public:
  struct Pace {
    absl::Duration interval = absl::Seconds(5);  // from the end of a try to the next
    int max_failures = 3;                        // tries in a row that must fail
  };
  // `ask` returns OK if the server was reached; it may block, but must return. `on_unreachable`
  // gets the last error, on the probe's thread: it must not destroy the probe. The probe ends with
  // this call.
  SelfProbe(std::function<absl::Status()> ask, const Pace& pace,
            std::function<void(const absl::Status&)> on_unreachable);
  // Waits for a try in progress.
  ~SelfProbe();
  SelfProbe(const SelfProbe&) = delete;
  SelfProbe& operator=(const SelfProbe&) = delete;

 private:
  void Run();

  const std::function<absl::Status()> ask_;
  const Pace pace_;
  const std::function<void(const absl::Status&)> on_unreachable_;
  std::mutex mutex_;
  std::condition_variable stop_;
  bool stopping_ = false;  // guarded by mutex_
  std::thread thread_;     // last: it uses all of the above
};

}  // namespace pepeseg
