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

// Finds out, again and again, whether what the services stand on works, and publishes of each
// service whether it serves. Each probe that may hang has a thread of its own, so that the
// monitor's sees that it does. Thread safe.
class HealthMonitor {
 public:
  struct Probe {
    std::string name;  // for the log
    // May block; must end in the end.
    std::function<absl::Status()> check;
    std::vector<std::string> services;  // that do not serve while it fails
    bool blocks = true;                 // false: it cannot hang, and needs no thread of its own
  };
  struct Pace {
    absl::Duration interval = absl::Seconds(2);  // between the end of a probe and the next
    absl::Duration patience = absl::Seconds(5);  // a probe that takes longer has failed
  };
  // Called when it has changed, never twice at once.
  using Publish = std::function<void(const std::string& service, bool serving)>;

  HealthMonitor(std::vector<std::string> services, std::vector<Probe> probes)
      : HealthMonitor(std::move(services), std::move(probes), Pace()) {}
  HealthMonitor(std::vector<std::string> services, std::vector<Probe> probes, const Pace& pace);
  // As Stop().
  ~HealthMonitor();
  HealthMonitor(const HealthMonitor&) = delete;
  HealthMonitor& operator=(const HealthMonitor&) = delete;

  // Publishes all services as serving, unless it drains, and begins to probe.
  void Start(Publish publish);
  // Nothing is published any more. Waits for probes under way. Once is enough.
  void Stop();

  // While it drains, no service serves. Published before it returns.
  void SetDraining(bool draining);
  bool draining() const;
  // As published last; all false before Start().
  std::map<std::string, bool> serving() const;

 private:
  struct Watched;  // a probe and what it said

  void RunProbe(Watched& watched);
  void ProbeLocked(Watched& watched, std::unique_lock<std::mutex>& lock);
  void Judge();
  void JudgeLocked();
  bool Works(const Watched& watched, absl::Time now) const;
  bool WaitLocked(std::unique_lock<std::mutex>& lock, absl::Duration time);  // false: stop

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

// Under so much, uploads and trainings have no place to write to.
inline constexpr int64_t kMinDiskFreeBytes = int64_t{256} << 20;

// Whether the folder takes a small file, to the disk, and its file system has over so much free:
// else RESOURCE_EXHAUSTED, or the error of the file.
absl::Status ProbeDisk(const std::filesystem::path& folder, int64_t min_free_bytes);

// INTERNAL: the device has an error that stays.
absl::Status ProbeDevice(const Backend& backend);

}  // namespace pepeseg
