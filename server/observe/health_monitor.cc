#include "server/observe/health_monitor.h"

#include <spdlog/spdlog.h>
#include <unistd.h>

#include <algorithm>
#include <string>
#include <system_error>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"
#include "core/base/file_io.h"
#include "core/base/status_macros.h"
#include "server/observe/process_use.h"

namespace pepeseg {

struct HealthMonitor::Watched {
  Probe probe;
  absl::Status status;                                // of the last run
  absl::Time running_since = absl::InfiniteFuture();  // InfiniteFuture: not running
  bool works = true;                                  // as judged last, for the log
};

HealthMonitor::HealthMonitor(std::vector<std::string> services, std::vector<Probe> probes,
                             const Pace& pace)
    : pace_(pace) {
  for (std::string& service : services) serving_[std::move(service)] = false;
  for (Probe& probe : probes) {
    probes_.push_back(std::make_unique<Watched>());
    probes_.back()->probe = std::move(probe);
  }
}

HealthMonitor::~HealthMonitor() { Stop(); }

void HealthMonitor::Start(Publish publish) {
  const std::lock_guard lock(mutex_);
  publish_ = std::move(publish);
  for (auto& [service, serving] : serving_) {
    serving = !draining_;
    publish_(service, serving);
  }
  for (const auto& watched : probes_) {
    if (!watched->probe.blocks) continue;
    threads_.emplace_back([this, &watched = *watched] { RunProbe(watched); });
  }
  threads_.emplace_back([this] { Judge(); });
}

void HealthMonitor::Stop() {
  std::vector<std::thread> threads;
  {
    const std::lock_guard lock(mutex_);
    stopping_ = true;
    threads.swap(threads_);
  }
  wake_.notify_all();
  for (std::thread& thread : threads) thread.join();
}

void HealthMonitor::SetDraining(bool draining) {
  const std::lock_guard lock(mutex_);
  draining_ = draining;
  JudgeLocked();
}

bool HealthMonitor::draining() const {
  const std::lock_guard lock(mutex_);
  return draining_;
}

std::map<std::string, bool> HealthMonitor::serving() const {
  const std::lock_guard lock(mutex_);
  return serving_;
}

bool HealthMonitor::WaitLocked(std::unique_lock<std::mutex>& lock, absl::Duration time) {
  return !wake_.wait_for(lock, absl::ToChronoMilliseconds(time), [this] { return stopping_; });
}

void HealthMonitor::ProbeLocked(Watched& watched, std::unique_lock<std::mutex>& lock) {
  watched.running_since = absl::Now();
  lock.unlock();
  const absl::Status status = watched.probe.check();
  lock.lock();
  watched.running_since = absl::InfiniteFuture();
  watched.status = status;
  JudgeLocked();
}

void HealthMonitor::RunProbe(Watched& watched) {
  std::unique_lock lock(mutex_);
  do {
    ProbeLocked(watched, lock);
  } while (WaitLocked(lock, pace_.interval));
}

// Wakes up at least every fifth of the timeout. A blocking probe calls JudgeLocked itself when it
// has ended; this thread notices when it does not end.
void HealthMonitor::Judge() {
  std::unique_lock lock(mutex_);
  while (WaitLocked(lock, std::min(pace_.interval, pace_.patience / 5))) {
    for (const auto& watched : probes_) {
      if (!watched->probe.blocks) ProbeLocked(*watched, lock);
    }
    JudgeLocked();
  }
}

bool HealthMonitor::Works(const Watched& watched, absl::Time now) const {
  return watched.status.ok() && now - watched.running_since <= pace_.patience;
}

// A service serves unless the server drains or one of its probes fails. The service "" stands for
// the whole server in grpc.health.v1; probes name it where they concern it. The caller must hold
// mutex_, under which `publish_` is called, so that changes are published in order.
void HealthMonitor::JudgeLocked() {
  if (stopping_ || !publish_) return;
  const absl::Time now = absl::Now();
  std::map<std::string, bool> serving = serving_;
  for (auto& [service, serves] : serving) serves = !draining_;
  for (const auto& watched : probes_) {
    const bool works = Works(*watched, now);
    if (!works) {
      for (const std::string& service : watched->probe.services) serving[service] = false;
    }
    if (works == std::exchange(watched->works, works)) continue;
    if (works) {
      spdlog::info("health: {} works again", watched->probe.name);
    } else {
      spdlog::error("health: {}: {}", watched->probe.name,
                    watched->status.ok() ? "no answer" : watched->status.ToString());
    }
  }
  for (const auto& [service, serves] : serving) {
    if (serving_[service] != serves) publish_(service, serves);
  }
  serving_ = serving;
}

absl::Status ProbeDisk(const std::filesystem::path& folder, int64_t min_free_bytes) {
  // Servers that share the folder must not use the same file.
  const std::filesystem::path file = folder / absl::StrCat(".health-", getpid());
  RETURN_IF_ERROR(WriteFileAtomically(file, "written by the health probe\n"));
  std::error_code error;
  std::filesystem::remove(file, error);
  if (error) {
    return absl::InternalError(absl::StrCat(file.string(), ": cannot remove: ", error.message()));
  }
  const int64_t free = DiskFreeBytes(folder);
  if (free < 0) return absl::InternalError(folder.string() + ": cannot read its free space");
  if (free > min_free_bytes) return absl::OkStatus();
  return absl::ResourceExhaustedError(absl::StrCat(folder.string(), ": ", free,
                                                   " bytes are free, must be over ", min_free_bytes,
                                                   ": uploads and trainings need room"));
}

absl::Status ProbeDevice(const Backend& backend) {
  // An error that is not fatal is cleared by the query that caused it: wait for that.
  constexpr absl::Duration kPause = absl::Milliseconds(100);
  std::string error = backend.error();
  for (int i = 0; i < 3 && !error.empty(); ++i) {
    absl::SleepFor(kPause);
    error = backend.error();
  }
  return error.empty() ? absl::OkStatus() : absl::InternalError(error);
}

}  // namespace pepeseg
