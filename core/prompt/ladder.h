#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "core/query/mask_grid.h"

namespace pepeseg {

// The things that a prompt may mean, smallest first: a part, the object that has it, a group.
struct Ladder {
  // Each has at least kMinGrowth times the area of the one before, holds at least kMinHeld of its
  // pixels, and has the same scale or a larger one.
  std::vector<MaskGrid::Plateau> rungs;
  int best = 0;  // index of the rung that the ladder was required to contain

  static constexpr double kMinGrowth = 1.5;
  static constexpr double kMinHeld = 0.95;
};

// Returns the ladder with the most total support among those that contain the plateau at index
// `best` of `plateaus` (all plateaus of MaskGrid::FindPlateaus). It has at most `max_count` rungs,
// and none if there are no plateaus. Many cells of the grid may show the same mask: each rung names
// a cell that keeps the ladder nested. The best rung's cell shows the mask of its plateau's most
// stable cell, the other cells have an IoU of at least 0.9 with theirs. A plateau of a single cell
// is a rung only if it is the best.
Ladder FindLadder(const MaskGrid& masks, std::span<const MaskGrid::Plateau> plateaus, size_t best,
                  int max_count);

}  // namespace pepeseg
