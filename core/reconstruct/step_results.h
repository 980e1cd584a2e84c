#pragma once

#include <array>
#include <cassert>
#include <cstdint>
#include <deque>
#include <span>
#include <type_traits>
#include <vector>

#include "core/reconstruct/depth_term.h"
#include "kernels/backend.h"

namespace pepeseg {

// Input of a step; enough to repeat it.
struct StepInput {
  int position = 0;           // of the schedule
  int view = 0;               // index among the training views
  int shrink = 1;             // 1, 2 or 4: divisor of the photograph's width and height
  int64_t num_gaussians = 0;  // of the state at that step
  Dropout dropout;
  DepthPlan depth;
};

// Layout of a step's sums: those of ImageLoss, then those of DepthLoss where the step had one.
inline constexpr int kFirstDepthSum = kNumImageLossSums;
inline constexpr int kNumLossSums = kFirstDepthSum + kNumDepthLossSums;

// Report of a step, read once the device has finished it.
struct StepResult {
  StepInput input;
  std::array<double, kNumLossSums> loss_sums = {};
  std::array<int64_t, kNumRenderCounters> counters = {};
  // The render overflowed its tile-entry capacity, so that the step changed nothing: see
  // RenderArgs::tile_entry_capacity.
  bool overflowed = false;
};

// Reads small results of a device without stopping it. Push queues a copy of a span as the ops
// called so far leave it; Pop returns the oldest copy and blocks only until it has arrived. The
// host can so be Backend::queue_depth() steps ahead. Since that number is fixed, what the host
// decides from the results does not depend on timing. One thread at a time. The backend must
// outlive it.
template <class T>
class ReadbackQueue {
  static_assert(std::is_trivially_copyable_v<T>);

 public:
  // Holds at most `capacity` copies (1..kMaxReadbacks) of `size` elements. Check allocated() before
  // the first Push.
  ReadbackQueue(Backend& backend, int64_t size, int capacity)
      : backend_(backend), size_(size), tickets_(static_cast<size_t>(capacity)) {
    pinned_ = static_cast<T*>(backend.AllocatePinned(tickets_.size() * BytesOfOne()));
  }
  ~ReadbackQueue() {
    if (pinned_ != nullptr) backend_.FreePinned(pinned_);
  }
  ReadbackQueue(const ReadbackQueue&) = delete;
  ReadbackQueue& operator=(const ReadbackQueue&) = delete;

  // False: there was no memory for the copies, and Push must not be called.
  bool allocated() const { return pinned_ != nullptr; }
  // Number of copies pushed and not yet popped.
  int64_t num_pending() const { return num_pushed_ - num_popped_; }

  // Queues a copy of `span`, which has `size` elements. num_pending() must be below the capacity.
  void Push(DeviceSpan<const T> span) {
    assert(span.size == size_ && num_pending() < static_cast<int64_t>(tickets_.size()));
    const size_t slot = Slot(num_pushed_++);
    tickets_[slot] = backend_.CopyToHostLater(At(slot), span.data, BytesOfOne());
  }
  // Returns the oldest copy; num_pending() must be above 0. The span is valid until `capacity`
  // copies after it have been pushed. After an error of the backend its contents are unspecified.
  std::span<const T> Pop() {
    assert(num_pending() > 0);
    const size_t slot = Slot(num_popped_++);
    backend_.WaitFor(tickets_[slot]);
    return {At(slot), static_cast<size_t>(size_)};
  }

 private:
  size_t BytesOfOne() const { return static_cast<size_t>(size_) * sizeof(T); }
  size_t Slot(int64_t number) const { return static_cast<size_t>(number) % tickets_.size(); }
  T* At(size_t slot) const { return pinned_ + slot * static_cast<size_t>(size_); }

  Backend& backend_;
  const int64_t size_;
  std::vector<int64_t> tickets_;
  T* pinned_ = nullptr;
  int64_t num_pushed_ = 0, num_popped_ = 0;
};

// Queue of the results of steps that the device has not finished. The host pushes the steps that
// are done at once together, and then pops until it is ahead of the device by
// Backend::queue_depth() steps at most. Results are copied to the host without waiting.
class StepResults {
 public:
  // num_slots: the number of steps that are done at once.
  StepResults(Backend& backend, int num_slots)
      : most_pending_(backend.queue_depth()),
        loss_sums_(backend, kNumLossSums, most_pending_ + num_slots),
        counters_(backend, kNumRenderCounters, most_pending_ + num_slots),
        num_overflowed_renders_(static_cast<size_t>(num_slots), 0) {}

  bool allocated() const { return loss_sums_.allocated() && counters_.allocated(); }
  bool empty() const { return pending_.empty(); }
  // True: Pop before the next steps begin.
  bool full() const { return static_cast<int>(pending_.size()) > most_pending_; }

  // slot: of the memory of the step, in [0, num_slots). `counters` are of the scratch of that slot.
  void Push(const StepInput& input, int slot, DeviceSpan<const double> loss_sums,
            DeviceSpan<const int64_t> counters);
  StepResult Pop();  // the oldest; waits for it

 private:
  struct Pending {
    StepInput input;
    int slot;
  };

  int most_pending_;
  std::deque<Pending> pending_;
  ReadbackQueue<double> loss_sums_;
  ReadbackQueue<int64_t> counters_;
  std::vector<int64_t> num_overflowed_renders_;  // by slot: the running count at its last Pop
};

// Tile-entry capacity of the next render of each view, predicted from the entries that its last
// render needed, so that the host need not wait for the count: see RenderArgs::tile_entry_capacity.
class TileEntryCapacities {
 public:
  explicit TileEntryCapacities(int num_views) : visits_(static_cast<size_t>(num_views)) {}

  // Returns the capacity for a step: the last need of the view at this size, scaled by the growth
  // of the Gaussians since, with slack. 0 before the first visit: the host waits for the count.
  int64_t For(const StepInput& input) const;
  // Records what a finished step needed.
  void Record(const StepResult& result);

 private:
  struct Visit {
    int64_t num_gaussians = 0, num_entries = 0;
  };
  std::vector<std::array<Visit, 3>> visits_;  // by shrink / 2
};

}  // namespace pepeseg
