#pragma once

#include <array>
#include <cstdint>
#include <deque>

#include "core/reconstruct/depth_term.h"
#include "kernels/backend.h"
#include "kernels/readback.h"

namespace pepeseg {

// What a step trained on, so that it can be repeated.
struct StepInput {
  int view = 0;
  int shrink = 1;
  int64_t num_gaussians = 0;
  DepthPlan depth;
};

// The sums of ImageLoss, then those of DepthLoss where the step had it.
inline constexpr int kFirstDepthSum = kNumImageLossSums;
inline constexpr int kNumLossSums = kFirstDepthSum + kNumDepthLossSums;

// What a step left, read when the device has come to it.
struct StepResult {
  StepInput input;
  std::array<double, kNumLossSums> loss_sums = {};
  std::array<int64_t, kNumRenderCounters> counters = {};
  bool was_void = false;  // its render lacked room and changed nothing: see RenderArgs::entry_room
};

// The results of the steps that the host is ahead of the device.
class StepResults {
 public:
  explicit StepResults(Backend& backend)
      : most_pending_(backend.queue_depth()),
        loss_sums_(backend, kNumLossSums, most_pending_ + 1),
        counters_(backend, kNumRenderCounters, most_pending_ + 1) {}

  bool allocated() const { return loss_sums_.allocated() && counters_.allocated(); }
  bool empty() const { return inputs_.empty(); }
  // The oldest is to be taken before another step begins.
  bool full() const { return static_cast<int>(inputs_.size()) > most_pending_; }

  void Push(const StepInput& input, DeviceSpan<const double> loss_sums,
            DeviceSpan<const int64_t> counters);
  StepResult Pop();  // the oldest; waits for it

 private:
  int most_pending_;
  std::deque<StepInput> inputs_;
  ReadbackQueue<double> loss_sums_;
  ReadbackQueue<int64_t> counters_;
  int64_t num_void_renders_ = 0;
};

}  // namespace pepeseg
