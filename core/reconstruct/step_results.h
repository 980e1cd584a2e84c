#pragma once

#include <array>
#include <cstdint>
#include <deque>
#include <vector>

#include "core/reconstruct/depth_term.h"
#include "kernels/backend.h"
#include "kernels/readback.h"

namespace pepeseg {

// What a step trained on; enough to repeat it.
struct StepInput {
  int view = 0;               // index among the training views
  int shrink = 1;             // 1, 2 or 4: divisor of the photograph's width and height
  int64_t num_gaussians = 0;  // of the state at that step
  DepthPlan depth;
};

// Layout of a step's sums: those of ImageLoss, then those of DepthLoss where the step had one.
inline constexpr int kFirstDepthSum = kNumImageLossSums;
inline constexpr int kNumLossSums = kFirstDepthSum + kNumDepthLossSums;

// What a step reported, read once the device has finished it.
struct StepResult {
  StepInput input;
  std::array<double, kNumLossSums> loss_sums = {};
  std::array<int64_t, kNumRenderCounters> counters = {};
  // The render overflowed its tile-entry capacity, so that the step changed nothing: see
  // RenderArgs::entry_room.
  bool overflowed = false;
};

// Queue of the results of steps that the device has not finished: the host is ahead of it by
// Backend::queue_depth() steps at most. Results are copied to the host without waiting.
class StepResults {
 public:
  explicit StepResults(Backend& backend)
      : most_pending_(backend.queue_depth()),
        loss_sums_(backend, kNumLossSums, most_pending_ + 1),
        counters_(backend, kNumRenderCounters, most_pending_ + 1) {}

  bool allocated() const { return loss_sums_.allocated() && counters_.allocated(); }
  bool empty() const { return inputs_.empty(); }
  // True: Pop before the next step begins.
  bool full() const { return static_cast<int>(inputs_.size()) > most_pending_; }

  void Push(const StepInput& input, DeviceSpan<const double> loss_sums,
            DeviceSpan<const int64_t> counters);
  StepResult Pop();  // the oldest; waits for it

 private:
  int most_pending_;
  std::deque<StepInput> inputs_;
  ReadbackQueue<double> loss_sums_;
  ReadbackQueue<int64_t> counters_;
  int64_t num_overflowed_renders_ = 0;  // the device's running count at the last Pop
};

// Tile-entry capacity of the next render of each view, predicted from the entries that its last
// render needed, so that the host need not wait for the count: see RenderArgs::entry_room.
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
