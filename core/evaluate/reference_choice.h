#pragma once

#include <cstddef>
#include <span>

#include "core/query/mask_grid.h"

namespace pepeseg {

// Returns the cell with the best IoU, the first of those that are equal. ious:
// [num_scales, num_thresholds], not empty.
GridCell BestCell(std::span<const double> ious, size_t num_thresholds);

// Chooses a scale and a threshold for other views from the IoUs in one view. Many cells score about
// the same there, and those in their middle hold in other views better than the best one, which is
// often at a limit. So the choice is the cell nearest to the mean of all cells, each weighted by
// exp((IoU - best IoU) / 0.01). As features are less sharp in other views, the mean threshold is
// lowered by 0.05 first. Only cells within 0.03 of the best IoU are chosen. Measured:
// tests/bench/results/choice.md.
//
// scales, thresholds: ascending, not empty. ious: [scales, thresholds].
GridCell ChooseFromReference(std::span<const double> ious, std::span<const double> scales,
                             std::span<const double> thresholds);

}  // namespace pepeseg
