#include "server/rpc/worker_pool.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace pepeseg {
namespace {

constexpr double kFirstBucketSeconds = 64e-6;
constexpr double kBucketsPerOctave = 4;

int BucketOf(absl::Duration took, int num_buckets) {
  const double ratio = absl::ToDoubleSeconds(took) / kFirstBucketSeconds;
  const int bucket =
      ratio <= 1 ? 0 : static_cast<int>(std::ceil(kBucketsPerOctave * std::log2(ratio)));
  return std::clamp(bucket, 0, num_buckets - 1);
}

// Returns the geometric mean of a bucket's ends.
absl::Duration ValueOf(int bucket) {
  return absl::Seconds(kFirstBucketSeconds * std::exp2((bucket - 0.5) / kBucketsPerOctave));
}

uint32_t SecondOf(absl::Time now) { return static_cast<uint32_t>(absl::ToUnixSeconds(now)); }

}  // namespace

// Adds one to the counter of a bucket, or restarts it at one if its slot still holds an older
// second: a compare-and-swap of second and count together, without a lock. Relaxed order suffices,
// since no other data depends on the counters.
void LatencyWindow::Record(absl::Duration took, absl::Time now) {
  const uint32_t second = SecondOf(now);
  std::atomic<uint64_t>& count = slots_[second % kSlots][BucketOf(took, kBuckets)];
  uint64_t seen = count.load(std::memory_order_relaxed);
  uint64_t next = 0;
  do {
    next = (seen >> 32) == second ? seen + 1 : (uint64_t{second} << 32) + 1;
  } while (!count.compare_exchange_weak(seen, next, std::memory_order_relaxed));
}

// Adds the counts of the last whole seconds. The current second is left out: it is incomplete and
// would make the rate look low.
void LatencyWindow::AddTo(absl::Time now, Counts& counts) const {
  const uint32_t second = SecondOf(now);
  for (const Slot& slot : slots_) {
    for (int bucket = 0; bucket < kBuckets; ++bucket) {
      const uint64_t seen = slot[bucket].load(std::memory_order_relaxed);
      const auto of = static_cast<uint32_t>(seen >> 32);
      if (of < second && of + kSeconds >= second) {
        counts[bucket] += static_cast<uint32_t>(seen);
      }
    }
  }
}

LatencyWindow::Quantiles LatencyWindow::QuantilesOf(const Counts& counts) {
  int64_t all = 0;
  for (const int64_t count : counts) all += count;
  const auto at = [&](double share) {
    const auto rank = static_cast<int64_t>(std::ceil(share * static_cast<double>(all)));
    int64_t below = 0;
    for (int bucket = 0; bucket < kBuckets; ++bucket) {
      below += counts[bucket];
      if (below >= rank) return ValueOf(bucket);
    }
    return ValueOf(kBuckets - 1);
  };
  if (all == 0) return {};
  return {static_cast<double>(all) / kSeconds, at(0.5), at(0.99)};
}

WorkerPool::WorkerPool(const Limits& limits) : limits_(limits) {
  for (int i = 0; i < limits.threads; ++i) threads_.emplace_back([this] { Run(); });
}

WorkerPool::~WorkerPool() { Stop(); }

bool WorkerPool::Submit(const std::string& owner, std::function<void()> task) {
  return Enqueue(owner, std::move(task), false);
}

bool WorkerPool::SubmitAlways(const std::string& owner, std::function<void()> task) {
  return Enqueue(owner, std::move(task), true);
}

bool WorkerPool::Enqueue(const std::string& owner, std::function<void()> task, bool always) {
  {
    const std::lock_guard lock(mutex_);
    const auto found = lines_.find(owner);
    const size_t num_of_owner = found == lines_.end() ? 0 : found->second.waiting.size();
    const bool full = num_queued_ >= limits_.queued ||
                      (limits_.queued_of_owner > 0 && num_of_owner >= limits_.queued_of_owner);
    if (stopping_ || (full && !always)) {
      ++num_refused_;
      return false;
    }
    Lines::value_type& line = found == lines_.end() ? *lines_.try_emplace(owner).first : *found;
    if (line.second.waiting.empty()) turns_.push_back(&line);
    line.second.waiting.push_back(std::move(task));
    ++num_queued_;
  }
  wake_.notify_one();
  return true;
}

WorkerPool::Use WorkerPool::use() const {
  const std::lock_guard lock(mutex_);
  return {limits_.threads, num_busy_, num_queued_, limits_.queued, num_refused_};
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

WorkerPool::Lines::value_type* WorkerPool::NextLineLocked() {
  const auto next = std::find_if(turns_.begin(), turns_.end(), [this](const auto* line) {
    return limits_.threads_of_owner == 0 || line->second.num_running < limits_.threads_of_owner;
  });
  return next == turns_.end() ? nullptr : *next;
}

std::function<void()> WorkerPool::TakeLocked(Lines::value_type& line) {
  turns_.erase(std::find(turns_.begin(), turns_.end(), &line));
  std::function<void()> task = std::move(line.second.waiting.front());
  line.second.waiting.pop_front();
  if (!line.second.waiting.empty()) turns_.push_back(&line);
  ++line.second.num_running;
  --num_queued_;
  ++num_busy_;
  return task;
}

void WorkerPool::EndTaskLocked(Lines::value_type& line) {
  --num_busy_;
  --line.second.num_running;
  if (line.second.num_running == 0 && line.second.waiting.empty()) lines_.erase(line.first);
}

void WorkerPool::Run() {
  std::unique_lock lock(mutex_);
  while (true) {
    Lines::value_type* line = nullptr;
    wake_.wait(lock, [&] {
      line = NextLineLocked();
      return line != nullptr || (stopping_ && num_queued_ == 0);
    });
    // Only when stopping: the queue is emptied before the threads end.
    if (line == nullptr) return;
    std::function<void()> task = TakeLocked(*line);
    lock.unlock();
    task();
    task = nullptr;  // while the thread counts as busy: what it holds may take long to destroy
    lock.lock();
    EndTaskLocked(*line);
    // An owner at its limit of threads may have a task that another thread can run now.
    if (limits_.threads_of_owner > 0 || stopping_) wake_.notify_all();
  }
}

WorkerPool& WorkerPools::Of(v1::Pool pool) {
  switch (pool) {
    case v1::POOL_UPLOAD:
      return upload;
    case v1::POOL_QUERY:
      return query;
    case v1::POOL_EVALUATION:
      return evaluation;
    case v1::POOL_CORRECTION:
      return correction;
    case v1::POOL_FIND:
      return find;
    case v1::POOL_ADMIN:
      return admin;
    default:
      return io;
  }
}

}  // namespace pepeseg
