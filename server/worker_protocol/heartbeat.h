#pragma once

#include <sys/types.h>

#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <mutex>
#include <thread>

// Heartbeats. A worker and the holder of its lease each touch a file in the job's folder at regular
// intervals, and watch the other's. Only changes of the file's time count, measured by the
// watcher's steady clock: the machines' clocks need not agree, and a machine that was suspended has
// missed nothing.
namespace pepeseg {

// Creates `path` if needed and sets its time to now. False: that failed.
bool Touch(const std::filesystem::path& path);

// Watches the time of one file. Not thread safe.
class HeartbeatWatch {
 public:
  explicit HeartbeatWatch(std::filesystem::path path) : path_(std::move(path)) {}

  // From now on the time that a missing file stays missing counts, too.
  void Expect();
  // Looks at the file, and returns how long ago it was last seen to change; 0 while it is missing
  // and Expect was not called.
  std::chrono::steady_clock::duration SinceChange();

 private:
  std::filesystem::path path_;
  bool seen_ = false;
  timespec newest_{};
  std::chrono::steady_clock::time_point change_{};
};

// The worker's side. A thread of its own touches `heartbeat` every second (with a short lease, more
// often) until the object is destroyed. With a lease, that thread calls `lost` once `lease` was not
// touched for 0.7 of `length`: the rest allows for the delay between the holder's renewal in the
// database and its touch of this file.
class WorkerHeartbeat {
 public:
  WorkerHeartbeat(const std::filesystem::path& heartbeat, const std::filesystem::path& lease,
              std::chrono::seconds length, std::function<void()> lost);
  ~WorkerHeartbeat();
  WorkerHeartbeat(const WorkerHeartbeat&) = delete;
  WorkerHeartbeat& operator=(const WorkerHeartbeat&) = delete;

 private:
  void Run();

  const std::filesystem::path heartbeat_;
  const std::chrono::seconds length_;  // of the lease; 0: no lease
  const std::function<void()> lost_;
  HeartbeatWatch lease_;
  std::mutex mutex_;
  std::condition_variable stop_;
  bool stopping_ = false;
  std::thread thread_;
};

}  // namespace pepeseg
