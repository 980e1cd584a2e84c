#include "core/reconstruct/step_slot.h"

#include <algorithm>

namespace pepeseg {
namespace {

// Pixels in flight that fill an H200; more steps at once only take memory.
constexpr int64_t kPixelsAtOnce = 1'000'000;
constexpr int64_t kMostAtOnce = 4;

}  // namespace

int StepsAtOnce(const Backend& backend, const ReconstructOptions& options, int64_t max_pixels) {
  if (options.depth_weight > 0) return 1;
  if (options.views_at_once > 0) return options.views_at_once;
  const int64_t needed = kPixelsAtOnce / std::max<int64_t>(1, max_pixels);
  const int64_t most = std::min<int64_t>(kMostAtOnce, backend.num_branches());
  return static_cast<int>(std::clamp<int64_t>(needed, 1, most));
}

}  // namespace pepeseg
