#include "core/reconstruct/step_results.h"

#include <algorithm>

namespace pepeseg {
namespace {

// Of TileEntryCapacities: factor on what a render needed, and entries added to every prediction.
constexpr double kSlack = 1.15;
constexpr int64_t kLeast = 16384;

}  // namespace

void StepResults::Push(const StepInput& input, int slot, DeviceSpan<const double> loss_sums,
                       DeviceSpan<const int64_t> counters) {
  pending_.push_back({input, slot});
  loss_sums_.Push(loss_sums);
  counters_.Push(counters.Subspan(0, kNumRenderCounters));
}

// The device counts the overflowed renders of a slot since its start: this step overflowed where
// the count rose.
StepResult StepResults::Pop() {
  StepResult result;
  const Pending step = pending_.front();
  pending_.pop_front();
  result.input = step.input;
  std::ranges::copy(loss_sums_.Pop(), result.loss_sums.begin());
  std::ranges::copy(counters_.Pop(), result.counters.begin());
  int64_t& num_overflowed = num_overflowed_renders_[static_cast<size_t>(step.slot)];
  result.overflowed = result.counters[kNumOverflowedRenders] > num_overflowed;
  num_overflowed = result.counters[kNumOverflowedRenders];
  return result;
}

int64_t TileEntryCapacities::For(const StepInput& input) const {
  const Visit& visit = visits_[static_cast<size_t>(input.view)][input.shrink / 2];
  if (visit.num_gaussians == 0) return 0;
  const double growth =
      static_cast<double>(input.num_gaussians) / static_cast<double>(visit.num_gaussians);
  const double need = static_cast<double>(visit.num_entries) * (growth > 1 ? growth : 1);
  return static_cast<int64_t>(kSlack * need) + kLeast;
}

void TileEntryCapacities::Record(const StepResult& result) {
  visits_[static_cast<size_t>(result.input.view)][result.input.shrink / 2] = {
      result.input.num_gaussians, result.counters[kNumTileEntries]};
}

}  // namespace pepeseg
