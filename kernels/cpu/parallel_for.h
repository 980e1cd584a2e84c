#pragma once

#include <atomic>
#include <condition_variable>
#include <cstdint>
#include <functional>
#include <mutex>
#include <thread>
#include <vector>

namespace pepeseg {

// The only threads of the CPU backend. The caller works too, so a pool of 1 starts no thread.
class ThreadPool {
 public:
  explicit ThreadPool(int num_threads);  // 0: as many as the machine has
  ~ThreadPool();
  ThreadPool(const ThreadPool&) = delete;
  ThreadPool& operator=(const ThreadPool&) = delete;

  int num_threads() const { return static_cast<int>(workers_.size()) + 1; }

  // Calls body(i, thread) once for each i in [0, count), in any order, and returns when all are
  // done; thread is in [0, num_threads()) and no two calls at a time share it. Tasks are handed out
  // one by one. Calls from several threads take turns. A body must not call ParallelFor.
  void ParallelFor(int64_t count, const std::function<void(int64_t i, int thread)>& body);

 private:
  void Work(int thread);

  std::mutex caller_mutex_;  // one parallel region at a time
  std::mutex mutex_;
  std::condition_variable start_, done_;
  const std::function<void(int64_t, int)>* body_ = nullptr;
  int64_t count_ = 0;
  std::atomic<int64_t> next_ = 0;
  int64_t generation_ = 0;
  int num_working_ = 0;
  bool stopping_ = false;
  std::vector<std::thread> workers_;
};

}  // namespace pepeseg
