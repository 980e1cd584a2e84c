#pragma once

#include <array>
#include <atomic>
#include <cstdint>

#include "absl/time/time.h"

namespace pepeseg {

// How long what was done in the last ten seconds took. Thread safe; those who record wait for
// nobody.
class LatencyWindow {
 public:
  struct Quantiles {
    double per_second = 0;
    // To within 10 %; zero where nothing was done.
    absl::Duration p50, p99;
  };

  void Record(absl::Duration took, absl::Time now);

 private:
  static constexpr int kSeconds = 10;
  // Whole seconds, and the one that is under way.
  static constexpr int kSlots = kSeconds + 1;
  // Upper ends in steps of 2^(1/4), from 64 us to over 10 minutes.
  static constexpr int kBuckets = 96;
  // The second in the upper half, the count in the lower one: so a slot of an old second need not
  // be emptied before it is used again.
  using Slot = std::array<std::atomic<uint64_t>, kBuckets>;

 public:
  // Of several windows together.
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
