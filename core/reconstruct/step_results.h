#pragma once

#include <array>
#include <cstdint>
#include <deque>

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
  bool was_void = false;
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
  int64_t num_void_renders_ = 0;  // the device's running count at the last Pop
};

}  // namespace pepeseg
