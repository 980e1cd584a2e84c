#pragma once

#include <condition_variable>
#include <cstddef>
#include <deque>
#include <functional>
#include <mutex>
#include <thread>
#include <vector>

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

 private:
  bool Enqueue(std::function<void()> task, size_t max_queued);
  void Run();

  const size_t max_queued_;
  std::mutex mutex_;
  std::condition_variable wake_;
  std::deque<std::function<void()>> queue_;
  bool stopping_ = false;
  std::vector<std::thread> threads_;
};

}  // namespace pepeseg
