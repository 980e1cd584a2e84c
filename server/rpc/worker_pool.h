#pragma once

#include <array>
#include <atomic>
#include <condition_variable>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <functional>
#include <map>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "absl/time/time.h"
#include "pepeseg/v1/access.pb.h"

namespace pepeseg {

// Latency quantiles over a sliding window of ten seconds. Thread safe; Record() never blocks.
class LatencyWindow {
 public:
  struct Quantiles {
    double per_second = 0;
    // Accurate to within 10 %; zero if nothing was recorded.
    absl::Duration p50, p99;
  };

  void Record(absl::Duration took, absl::Time now);

 private:
  static constexpr int kSeconds = 10;
  // The last ten whole seconds, and the current one.
  static constexpr int kSlots = kSeconds + 1;
  // Upper ends grow by 2^(1/4), from 64 us to over 10 minutes.
  static constexpr int kBuckets = 96;
  // Each counter holds its second in the upper 32 bits and the count in the lower 32, so that a
  // slot need not be cleared before a later second uses it again.
  using Slot = std::array<std::atomic<uint64_t>, kBuckets>;

 public:
  // Returns the quantiles of several windows together.
  template <typename... Windows>
  static Quantiles Summarize(absl::Time now, const Windows&... windows) {
    Counts counts{};
    (windows.AddTo(now, counts), ...);
    return QuantilesOf(counts);
  }

 private:
  using Counts = std::array<int64_t, kBuckets>;
  void AddTo(absl::Time now, Counts& counts) const;
  static Quantiles QuantilesOf(const Counts& counts);

  std::array<Slot, kSlots> slots_{};
};

// Threads for everything that blocks. A reaction of gRPC's callback API must never block: two that
// do would freeze a server on two cores, including its health service.
//
// Each task has an owner, the project that it works for. Owners whose tasks wait are served in
// turn, one task each; the tasks of one owner run in the order in which they came. Work that takes
// long is cut into tasks, each of which submits the next one. An owner then waits for at most one
// task of each other owner. Thread safe.
class WorkerPool {
 public:
  struct Limits {
    int threads = 1;
    size_t queued = 0;  // tasks that wait, of all owners
    // The part of an owner: threads that work for it at a time, and tasks of it that wait. 0: all.
    int threads_of_owner = 0;
    size_t queued_of_owner = 0;
  };
  explicit WorkerPool(const Limits& limits);
  // Calls Stop().
  ~WorkerPool();
  WorkerPool(const WorkerPool&) = delete;
  WorkerPool& operator=(const WorkerPool&) = delete;

  // Queues `task`. Returns false, and does not run it, if the queue or the owner's part of it is
  // full, or the pool has stopped.
  bool Submit(const std::string& owner, std::function<void()> task);
  // Queues `task` however long the queue is, for streams, whose number is bounded, and for the rest
  // of work that has begun. Returns false only after Stop().
  bool SubmitAlways(const std::string& owner, std::function<void()> task);
  // Runs what is queued, then joins the threads. Must not be called from a task.
  void Stop();

  // While the pool drains, callers should refuse new calls. What is queued still runs.
  void SetDraining(bool draining) { draining_ = draining; }
  bool draining() const { return draining_; }

  struct Use {
    int num_threads = 0, num_busy = 0;
    size_t num_queued = 0, max_queued = 0;
    int64_t num_refused = 0;  // by Submit, since the start
  };
  Use use() const;
  // Times of calls, from the start on a thread to the answer, recorded by those who answer.
  LatencyWindow& latencies() { return latencies_; }
  const LatencyWindow& latencies() const { return latencies_; }

 private:
  // The tasks of an owner. It exists while one of them waits or runs.
  struct Line {
    std::deque<std::function<void()>> waiting;
    int num_running = 0;
  };
  using Lines = std::map<std::string, Line>;

  bool Enqueue(const std::string& owner, std::function<void()> task, bool always);
  // Returns the line whose turn it is; nullptr if no task may run now. Calls with `Locked` in their
  // names need mutex_.
  Lines::value_type* NextLineLocked();
  std::function<void()> TakeLocked(Lines::value_type& line);
  void EndTaskLocked(Lines::value_type& line);
  void Run();

  const Limits limits_;
  std::atomic<bool> draining_ = false;
  LatencyWindow latencies_;
  mutable std::mutex mutex_;  // guards all below
  int num_busy_ = 0;
  size_t num_queued_ = 0;
  int64_t num_refused_ = 0;
  std::condition_variable wake_;
  Lines lines_;
  std::deque<Lines::value_type*> turns_;  // lines with waiting tasks, the next to be served first
  bool stopping_ = false;
  std::vector<std::thread> threads_;
};

// The pools of a server's calls. Each kind of work has its own threads, so that it waits only for
// work of its kind.
struct WorkerPools {
  WorkerPool io;          // short calls that wait for the disk or the database
  WorkerPool upload;      // calls that do so for long, such as for each of thousands of files
  WorkerPool query;       // calls that compute
  WorkerPool evaluation;  // calls that compute for long
  WorkerPool correction;  // calls that train a model for seconds
  WorkerPool find;        // calls that look for things, maybe by a program of the operator
  WorkerPool border;      // calls that wait for SAM, which answers one at a time
  WorkerPool admin;       // calls of operators

  // Returns the pool by the name that the contract gives it.
  WorkerPool& Of(v1::Pool pool);
  // Drains all pools but `admin`, whose calls are answered until the end.
  void SetDraining(bool draining) {
    for (WorkerPool* pool : {&io, &upload, &query, &evaluation, &correction, &find, &border}) {
      pool->SetDraining(draining);
    }
  }
  void Stop() {
    for (WorkerPool* pool :
         {&io, &upload, &query, &evaluation, &correction, &find, &border, &admin}) {
      pool->Stop();
    }
  }
};

}  // namespace pepeseg
