#include "core/reconstruct/step_results.h"

#include <algorithm>

namespace pepeseg {

void StepResults::Push(const StepInput& input, DeviceSpan<const double> loss_sums,
                       DeviceSpan<const int64_t> counters) {
  inputs_.push_back(input);
  loss_sums_.Push(loss_sums);
  counters_.Push(counters.Subspan(0, kNumRenderCounters));
}

// The device counts overflowed renders since its start: this step overflowed where the count rose.
StepResult StepResults::Pop() {
  StepResult result;
  result.input = inputs_.front();
  inputs_.pop_front();
  std::ranges::copy(loss_sums_.Pop(), result.loss_sums.begin());
  std::ranges::copy(counters_.Pop(), result.counters.begin());
  result.overflowed = result.counters[kNumVoidRenders] > num_overflowed_renders_;
  num_overflowed_renders_ = result.counters[kNumVoidRenders];
  return result;
}

}  // namespace pepeseg
