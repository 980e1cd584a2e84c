#pragma once

#include <sys/types.h>

#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <mutex>
#include <thread>

// A worker and whoever holds its lease show each other that they live by touching a file of the
// job's folder now and then. Only changes of its time count, by the watcher's own steady clock: the
// machines' clocks need not agree, and a machine that sleeps misses nothing.
namespace pepeseg {

// Makes `path` and gives it the current time. False: it could not be made, or touched.
bool Touch(const std::filesystem::path& path);

// Watches one file. Not thread safe.
class PulseWatch {
 public:
  explicit PulseWatch(std::filesystem::path path) : path_(std::move(path)) {}

  // From now on a file that is not there yet is silence, too.
  void Expect();
  // Looks, and answers how long ago the file was last seen to change; 0 while it is not there.
  std::chrono::steady_clock::duration Silence();

 private:
  std::filesystem::path path_;
  bool seen_ = false;
  timespec newest_{};
  std::chrono::steady_clock::time_point change_{};
};

// The worker's side: touches `pulse` every second until it is destroyed. With a lease, calls `lost`
// from its own thread once `lease` was not touched for seven tenths of it: the rest is for what
// there is between the holder's promise to the database and this file.
class WorkerPulse {
 public:
  WorkerPulse(const std::filesystem::path& pulse, const std::filesystem::path& lease,
              std::chrono::seconds length, std::function<void()> lost);
  ~WorkerPulse();
  WorkerPulse(const WorkerPulse&) = delete;
  WorkerPulse& operator=(const WorkerPulse&) = delete;

 private:
  void Run();

  const std::filesystem::path pulse_;
  const std::chrono::seconds length_;  // of the lease; 0: there is none
  const std::function<void()> lost_;
  PulseWatch lease_;
  std::mutex mutex_;
  std::condition_variable stop_;
  bool stopping_ = false;
  std::thread thread_;
};

}  // namespace pepeseg
