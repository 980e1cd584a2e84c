#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "core/query/mask_grid.h"

namespace pepeseg {

// The things that a prompt may mean, smallest first: a part, the object that has it, a group.
struct Ladder {
  // Each has at least kMinGrowth times the area of the one before, holds at least kMinHeld of its
  // pixels, and stands at the same scale or a larger one.
  std::vector<MaskGrid::Plateau> rungs;
  int best = 0;  // index of the rung that the ladder was looked for through

  static constexpr double kMinGrowth = 1.5;
  static constexpr double kMinHeld = 0.95;
};

// Returns the ladder of `plateaus` (MaskGrid::FindPlateaus, all of them) that has the most support
// in all, of those through the plateau at index `best`. It has at most `max_count` rungs, and none
// where there is no plateau. A mask may be shown
// by many cells of the grid: each rung names the cell that makes the ladder possible, the best one
// with the mask of its most stable cell, the others within an IoU of 0.9 of it. A plateau of a
// single cell is a rung only if it is the best.
Ladder FindLadder(const MaskGrid& masks, std::span<const MaskGrid::Plateau> plateaus, size_t best,
                  int max_count);

}  // namespace pepeseg
