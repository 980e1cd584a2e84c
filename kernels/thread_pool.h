#pragma once

#include <atomic>
#include <condition_variable>
#include <cstdint>
#include <functional>
#include <mutex>
#include <thread>
#include <vector>

namespace pepeseg {

// The threads of a CPU backend, which live as long as it. The calling thread takes tasks, too, so a
// pool of 1 starts no thread.
class ThreadPool {
 public:
  // num_threads <= 0: as many as the machine has.
  explicit ThreadPool(int num_threads);
  // Joins the threads. No ParallelFor may be running.
  ~ThreadPool();
  ThreadPool(const ThreadPool&) = delete;
  ThreadPool& operator=(const ThreadPool&) = delete;

  // Number of threads that take tasks, the caller included.
  int num_threads() const { return static_cast<int>(workers_.size()) + 1; }

  // Calls body(i, thread) once for each i in [0, count), in any order, and returns when all calls
  // have. `thread` is in [0, num_threads()), and no two calls running at once have the same, so
  // that it can index working memory. Tasks are handed out one by one. Regions of several calling
  // threads run one after another. A body must not throw, nor call ParallelFor, which would
  // deadlock.
  void ParallelFor(int64_t count, const std::function<void(int64_t i, int thread)>& body);

 private:
  // Main loop of a worker.
  void Work(int thread);

  std::mutex caller_mutex_;               // held for a whole parallel region
  std::mutex mutex_;                      // guards what follows, except next_
  std::condition_variable start_, done_;  // a region has begun; the last worker has signed off
  const std::function<void(int64_t, int)>* body_ = nullptr;
  int64_t count_ = 0;
  std::atomic<int64_t> next_ = 0;  // the next task to take; may pass count_
  int64_t generation_ = 0;         // number of the region
  int num_working_ = 0;            // workers that have not signed off the region
  bool stopping_ = false;
  std::vector<std::thread> workers_;
};

}  // namespace pepeseg
