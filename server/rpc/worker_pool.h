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

// Threads for everything that blocks. A reaction of gRPC's callback API must never block: two that
// do would freeze a server on two cores, including its health service. Thread safe.
class WorkerPool {
 public:
  WorkerPool(int num_threads, size_t max_queued);
  // Calls Stop().
  ~WorkerPool();
  WorkerPool(const WorkerPool&) = delete;
  WorkerPool& operator=(const WorkerPool&) = delete;

  // Queues `task`. Returns false, and does not run it, if the queue is full or the pool has
  // stopped.
  bool Submit(std::function<void()> task);
  // Queues `task` however long the queue is, for work of streams, whose number is bounded. Returns
  // false only after Stop().
  bool SubmitAlways(std::function<void()> task);
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

// The pools of a server's calls. Each kind of work has its own threads, so that it waits only for
// work of its kind.
struct WorkerPools {
  WorkerPool io;          // short calls that wait for the disk or the database
  WorkerPool upload;      // calls that do so for long, such as for each of thousands of files
  WorkerPool query;       // calls that compute
  WorkerPool evaluation;  // calls that compute for long

  void SetDraining(bool draining) {
    for (WorkerPool* pool : {&io, &upload, &query, &evaluation}) pool->SetDraining(draining);
  }
  void Stop() {
    for (WorkerPool* pool : {&io, &upload, &query, &evaluation}) pool->Stop();
  }
};

}  // namespace pepeseg
