#pragma once

#include <atomic>
#include <condition_variable>
#include <cstddef>
#include <deque>
#include <functional>
#include <mutex>
#include <thread>
#include <vector>

#include "server/observe/latency_window.h"

namespace pepeseg {

// Threads for everything that blocks: a reaction of gRPC's callback API must never do so (two that
// did would freeze a server of two cores, its health service included). Thread safe.
class WorkerPool {
 public:
  WorkerPool(int num_threads, size_t max_queued);
  // As Stop().
  ~WorkerPool();
  WorkerPool(const WorkerPool&) = delete;
  WorkerPool& operator=(const WorkerPool&) = delete;

  // false, and `task` is not run: the queue is full, or the pool has stopped.
  bool Submit(std::function<void()> task);
  // Like Submit, but takes the task however long the queue is, for work of a bounded number of
  // streams; false only after Stop().
  bool SubmitAlways(std::function<void()> task);
  // Runs what is queued, then joins. Not from a task.
  void Stop();

  // While it drains, calls should be refused; what is queued runs.
  void SetDraining(bool draining) { draining_ = draining; }
  bool draining() const { return draining_; }

  struct Use {
    int num_threads = 0, num_busy = 0;
    size_t num_queued = 0, max_queued = 0;
    int64_t num_refused = 0;  // by Submit, since the start
  };
  Use use() const;
  // Of calls, from a thread's taking them to the answer; whoever answers them records it.
  LatencyWindow& latencies() { return latencies_; }
  const LatencyWindow& latencies() const { return latencies_; }

 private:
  bool Enqueue(std::function<void()> task, size_t max_queued);
  void Run();

  const int num_threads_;
  const size_t max_queued_;
  std::atomic<bool> draining_ = false;
  LatencyWindow latencies_;
  mutable std::mutex mutex_;  // guards all below
  int num_busy_ = 0;
  int64_t num_refused_ = 0;
  std::condition_variable wake_;
  std::deque<std::function<void()>> queue_;
  bool stopping_ = false;
  std::vector<std::thread> threads_;
};

}  // namespace pepeseg
