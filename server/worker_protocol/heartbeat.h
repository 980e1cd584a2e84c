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
// intervals, and watch the file of the other. A watcher only notes that the file's time has
// changed, and measures the time since then by its own steady clock. So the clocks of the machines
// need not agree, and the time during which a machine was suspended does not count.
namespace pepeseg {

// Sets the modification time of `path` to now, and creates the file if it is missing. Returns false
// if that failed.
bool Touch(const std::filesystem::path& path);
// The same in a worker, by writing a byte: its sandbox refuses calls that set a file's times. Not
// for the server, which must not write to what a worker may have put in a file's place.
bool Beat(const std::filesystem::path& path);

// Watches the time of one file. Not thread safe.
class HeartbeatWatch {
 public:
  explicit HeartbeatWatch(std::filesystem::path path) : path_(std::move(path)) {}

  // Starts the clock now, even if the file is missing.
  void Expect();
  // Looks at the file, and returns the time since its last change was seen. Returns 0 if the file
  // has not existed yet and Expect() was not called.
  std::chrono::steady_clock::duration SinceChange();

 private:
  std::filesystem::path path_;
  bool seen_ = false;                               // change_ is set
  timespec newest_{};                               // modification time at the last look
  std::chrono::steady_clock::time_point change_{};  // when the last change was seen
};

// The worker's side. A thread touches the file `heartbeat` every second, or every twentieth of
// `length` if that is shorter, until the object is destroyed. The same thread calls `lost` when the
// file `lease` has not been touched for 0.7 of `length`, and again at each further beat. The other
// 0.3 allow for the delay between the holder's renewal in the database and its touch of the file.
// A `length` of 0 stands for no lease: `lost` is never called.
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
  const std::chrono::seconds length_;  // lease duration; 0: no lease
  const std::function<void()> lost_;
  HeartbeatWatch lease_;
  std::mutex mutex_;
  std::condition_variable stop_;
  bool stopping_ = false;
  std::thread thread_;
};

}  // namespace pepeseg
