#pragma once

#include <condition_variable>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "absl/status/status.h"
#include "absl/time/time.h"
#include "kernels/backend.h"

namespace pepeseg {

// Probes the disk, the database and the device periodically, and publishes whether each service can
// serve. Each probe that may hang has a thread of its own, so that the monitor's thread notices
// when it hangs. Thread safe.
class HealthMonitor {
 public:
  struct Probe {
    std::string name;  // for the log
    // May block, but must return at some time.
    std::function<absl::Status()> check;
    std::vector<std::string> services;  // those that cannot serve while the probe fails
    bool blocks = true;                 // false: it cannot hang, and needs no thread of its own
  };
  struct Pace {
    absl::Duration interval = absl::Seconds(2);  // from the end of a probe to the next
    absl::Duration patience = absl::Seconds(5);  // timeout: a probe that takes longer has failed
  };
  // Called when a service's state changes, with the monitor's mutex held: it must not call the
  // monitor.
  using Publish = std::function<void(const std::string& service, bool serving)>;

  HealthMonitor(std::vector<std::string> services, std::vector<Probe> probes)
      : HealthMonitor(std::move(services), std::move(probes), Pace()) {}
  HealthMonitor(std::vector<std::string> services, std::vector<Probe> probes, const Pace& pace);
  // Calls Stop().
  ~HealthMonitor();
  HealthMonitor(const HealthMonitor&) = delete;
  HealthMonitor& operator=(const HealthMonitor&) = delete;

  // Publishes all services as serving, unless the server drains, and starts the probes.
  void Start(Publish publish);
  // Stops publishing, and waits for probes in progress. Further calls do nothing.
  void Stop();

  // While the server drains, no service serves. Publishes the change before it returns.
  void SetDraining(bool draining);
  bool draining() const;
  // Returns what was published last; all false before Start().
  std::map<std::string, bool> serving() const;

 private:
  struct Watched;  // a probe and its last result

  // Body of the thread of a probe that may hang.
  void RunProbe(Watched& watched);
  // Runs a probe once. Releases the lock while it runs.
  void ProbeLocked(Watched& watched, std::unique_lock<std::mutex>& lock);
  // Body of the monitor's thread: runs the probes that cannot hang, and notices those that do.
  void Judge();
  // Computes which services can serve, and publishes and logs the changes.
  void JudgeLocked();
  bool Works(const Watched& watched, absl::Time now) const;
  // Waits, and returns false if the monitor stops.
  bool WaitLocked(std::unique_lock<std::mutex>& lock, absl::Duration time);

  const Pace pace_;
  mutable std::mutex mutex_;  // guards all below
  std::condition_variable wake_;
  bool stopping_ = false;
  bool draining_ = false;
  Publish publish_;
  std::map<std::string, bool> serving_;
  std::vector<std::unique_ptr<Watched>> probes_;
  std::vector<std::thread> threads_;
};

// Free disk space below which uploads and trainings cannot work, bytes.
inline constexpr int64_t kMinDiskFreeBytes = int64_t{256} << 20;

// Writes a small file to the folder, durably, and removes it again. Returns the error of doing so,
// or RESOURCE_EXHAUSTED unless more than `min_free_bytes` of the file system are free.
absl::Status ProbeDisk(const std::filesystem::path& folder, int64_t min_free_bytes);

// Returns INTERNAL if the device has an error that persists. Takes up to 300 ms then.
absl::Status ProbeDevice(const Backend& backend);

}  // namespace pepeseg
