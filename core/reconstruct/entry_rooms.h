#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "core/reconstruct/step_results.h"

namespace pepeseg {

// Tile-entry capacity of the next render of each view, predicted from the entries that its last
// render needed, so that the host need not wait for the count: see RenderArgs::entry_room.
class EntryRooms {
 public:
  explicit EntryRooms(int num_views) : visits_(static_cast<size_t>(num_views)) {}

  // Returns the capacity for a step: the last need of the view at this size, scaled by the growth
  // of the Gaussians since, with slack. 0 before the first visit: the host waits for the count.
  int64_t For(const StepInput& input) const {
    const Visit& visit = visits_[static_cast<size_t>(input.view)][input.shrink / 2];
    if (visit.num_gaussians == 0) return 0;
    const double growth =
        static_cast<double>(input.num_gaussians) / static_cast<double>(visit.num_gaussians);
    const double need = static_cast<double>(visit.num_entries) * (growth > 1 ? growth : 1);
    return static_cast<int64_t>(kSlack * need) + kLeast;
  }
  // Records what a finished step needed.
  void Learn(const StepResult& result) {
    visits_[static_cast<size_t>(result.input.view)][result.input.shrink / 2] = {
        result.input.num_gaussians, result.counters[kNumTileEntries]};
  }

 private:
  static constexpr double kSlack = 1.15;
  static constexpr int64_t kLeast = 16384;  // entries added to every prediction
  struct Visit {
    int64_t num_gaussians = 0, num_entries = 0;
  };
  std::vector<std::array<Visit, 3>> visits_;  // by shrink / 2
};

}  // namespace pepeseg
