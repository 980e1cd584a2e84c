#include "kernels/thread_pool.h"

#include <algorithm>

// Locking. mutex_ guards body_, count_, generation_, num_working_ and stopping_. next_ is atomic,
// so that tasks are taken without the lock; while the pool is idle only the caller changes it. Each
// parallel region has a number, generation_: a worker that finds a new one copies body and count,
// takes tasks until none is left and signs off by num_working_. ParallelFor returns only when all
// workers have signed off, so no worker can see a body that is gone, and everything that the tasks
// wrote is visible to the caller. caller_mutex_ is held for the whole region and taken first.

namespace pepeseg {

ThreadPool::ThreadPool(int num_threads) {
  if (num_threads <= 0) num_threads = std::max(1u, std::thread::hardware_concurrency());
  for (int thread = 1; thread < num_threads; ++thread) {
    workers_.emplace_back([this, thread] { Work(thread); });
  }
}

// The flag is set under the lock: a worker that has just found no work cannot miss the
// notification.
ThreadPool::~ThreadPool() {
  {
    std::lock_guard lock(mutex_);
    stopping_ = true;
  }
  start_.notify_all();
  for (std::thread& worker : workers_) worker.join();
}

void ThreadPool::ParallelFor(int64_t count, const std::function<void(int64_t, int)>& body) {
  if (count <= 0) return;
  std::lock_guard turn(caller_mutex_);
  {
    std::lock_guard lock(mutex_);
    body_ = &body;
    count_ = count;
    next_ = 0;
    num_working_ = static_cast<int>(workers_.size());
    ++generation_;
  }
  start_.notify_all();
  // The caller is thread 0. Then it waits for workers that still run a task, or have yet to wake
  // up.
  for (int64_t i; (i = next_.fetch_add(1)) < count;) body(i, 0);
  std::unique_lock lock(mutex_);
  done_.wait(lock, [this] { return num_working_ == 0; });
}

// `seen` is the last region that this worker has signed off. The lock is held except while it takes
// tasks.
void ThreadPool::Work(int thread) {
  int64_t seen = 0;
  std::unique_lock lock(mutex_);
  while (true) {
    start_.wait(lock, [&] { return stopping_ || generation_ != seen; });
    if (stopping_) return;
    seen = generation_;
    const auto& body = *body_;
    const int64_t count = count_;
    lock.unlock();
    for (int64_t i; (i = next_.fetch_add(1)) < count;) body(i, thread);
    lock.lock();
    if (--num_working_ == 0) done_.notify_one();
  }
}

}  // namespace pepeseg
