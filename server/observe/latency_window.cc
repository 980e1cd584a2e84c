#include "server/observe/latency_window.h"

#include <algorithm>
#include <cmath>

namespace pepeseg {
namespace {

constexpr double kFirstSeconds = 64e-6;
constexpr double kStepsPerOctave = 4;

int BucketOf(absl::Duration took, int num_buckets) {
  const double ratio = absl::ToDoubleSeconds(took) / kFirstSeconds;
  const int bucket =
      ratio <= 1 ? 0 : static_cast<int>(std::ceil(kStepsPerOctave * std::log2(ratio)));
  return std::clamp(bucket, 0, num_buckets - 1);
}

// Returns the geometric mean of a bucket's ends.
absl::Duration ValueOf(int bucket) {
  return absl::Seconds(kFirstSeconds * std::exp2((bucket - 0.5) / kStepsPerOctave));
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

}  // namespace pepeseg
