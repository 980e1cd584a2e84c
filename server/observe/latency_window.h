#pragma once

#include <array>
#include <atomic>
#include <cstdint>

#include "absl/time/time.h"

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

}  // namespace pepeseg
