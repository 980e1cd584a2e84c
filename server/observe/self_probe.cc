#include "server/observe/self_probe.h"

#include <spdlog/spdlog.h>

#include <string>
#include <utility>

namespace pepeseg {

SelfProbe::SelfProbe(std::function<absl::Status()> ask, const Pace& pace,
                     std::function<void(const absl::Status&)> on_unreachable)
    : ask_(std::move(ask)),
      pace_(pace),
      on_unreachable_(std::move(on_unreachable)),
      thread_([this] { Run(); }) {}

SelfProbe::~SelfProbe() {
  {
    const std::lock_guard lock(mutex_);
    stopping_ = true;
  }
  stop_.notify_all();
  thread_.join();
}

void SelfProbe::Run() {
  int num_failures = 0;
  std::unique_lock lock(mutex_);
  while (!stop_.wait_for(lock, absl::ToChronoMilliseconds(pace_.interval),
                         [this] { return stopping_; })) {
    lock.unlock();
    const absl::Status status = ask_();
    lock.lock();
    if (status.ok()) {
      num_failures = 0;
      continue;
    }
    if (stopping_) return;
    ++num_failures;
    spdlog::warn("self-probe: failed {} of {} times: {}", num_failures, pace_.max_failures,
                 std::string(status.message()));
    if (num_failures < pace_.max_failures) continue;
    lock.unlock();
    return on_unreachable_(status);
  }
}

}  // namespace pepeseg
