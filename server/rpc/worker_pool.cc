#include "server/rpc/worker_pool.h"

#include <limits>
#include <utility>

namespace pepeseg {

WorkerPool::WorkerPool(int num_threads, size_t max_queued)
    : num_threads_(num_threads), max_queued_(max_queued) {
  for (int i = 0; i < num_threads; ++i) threads_.emplace_back([this] { Run(); });
}

WorkerPool::~WorkerPool() { Stop(); }

bool WorkerPool::Submit(std::function<void()> task) {
  return Enqueue(std::move(task), max_queued_);
}

bool WorkerPool::SubmitAlways(std::function<void()> task) {
  return Enqueue(std::move(task), std::numeric_limits<size_t>::max());
}

bool WorkerPool::Enqueue(std::function<void()> task, size_t max_queued) {
  {
    const std::lock_guard lock(mutex_);
    if (stopping_ || queue_.size() >= max_queued) {
      ++num_refused_;
      return false;
    }
    queue_.push_back(std::move(task));
  }
  wake_.notify_one();
  return true;
}

WorkerPool::Use WorkerPool::use() const {
  const std::lock_guard lock(mutex_);
  return {num_threads_, num_busy_, queue_.size(), max_queued_, num_refused_};
}

void WorkerPool::Stop() {
  std::vector<std::thread> threads;
  {
    const std::lock_guard lock(mutex_);
    stopping_ = true;
    // A second Stop(), from the destructor, then joins nothing. The mutex is free while the threads
    // are joined, since their tasks may submit others.
    threads.swap(threads_);
  }
  wake_.notify_all();
  for (std::thread& thread : threads) thread.join();
}

void WorkerPool::Run() {
  while (true) {
    std::function<void()> task;
    {
      std::unique_lock lock(mutex_);
      wake_.wait(lock, [this] { return stopping_ || !queue_.empty(); });
      // Only when stopping: the queue is emptied before the threads end.
      if (queue_.empty()) return;
      task = std::move(queue_.front());
      queue_.pop_front();
      ++num_busy_;
    }
    task();
    task = nullptr;  // while the thread counts as busy: what it holds may take long to destroy
    const std::lock_guard lock(mutex_);
    --num_busy_;
  }
}

}  // namespace pepeseg
