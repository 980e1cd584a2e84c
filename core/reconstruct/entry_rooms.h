#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "core/reconstruct/step_results.h"

namespace pepeseg {

// How much room a render of a view should take, from what it needed when it was last visited, so
// that the host need not wait for the count: see RenderArgs::entry_room.
class EntryRooms {
 public:
  explicit EntryRooms(int num_views) : visits_(static_cast<size_t>(num_views)) {}

  // 0 before the first visit at this size.
  int64_t For(const StepInput& input) const {
    const Visit& visit = visits_[static_cast<size_t>(input.view)][input.shrink / 2];
    if (visit.num_gaussians == 0) return 0;
    const double growth =
        static_cast<double>(input.num_gaussians) / static_cast<double>(visit.num_gaussians);
    const double need = static_cast<double>(visit.num_entries) * (growth > 1 ? growth : 1);
    return static_cast<int64_t>(kSlack * need) + kLeast;
  }
  void Learn(const StepResult& result) {
    visits_[static_cast<size_t>(result.input.view)][result.input.shrink / 2] = {
        result.input.num_gaussians, result.counters[kNumTileEntries]};
  }

 private:
  static constexpr double kSlack = 1.15;
  static constexpr int64_t kLeast = 16384;  // entries
  struct Visit {
    int64_t num_gaussians = 0, num_entries = 0;
  };
  std::vector<std::array<Visit, 3>> visits_;  // by shrink / 2
};

}  // namespace pepeseg
