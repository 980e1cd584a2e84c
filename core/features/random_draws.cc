#include "core/features/random_draws.h"

#include <algorithm>

#include "core/features/mask_scales.h"

namespace pepeseg {

PixelsByMask::PixelsByMask(const MaskSet& masks, std::span<const float> mask_scales,
                           std::span<const int32_t> pixels)
    : masks_(mask_scales.size()) {
  // Neighbouring pixels mostly lie in one mask cell, so the masks are read once per run of a cell.
  const auto size = static_cast<int64_t>(pixels.size());
  for (int64_t first = 0, end = 0; first < size; first = end) {
    const auto cell = static_cast<size_t>(masks.pixel_cell[pixels[first]]);
    while (end < size && static_cast<size_t>(masks.pixel_cell[pixels[end]]) == cell) ++end;
    ForEachMaskIn(CellBits(masks, cell), [&](int mask) {
      if (mask_scales[mask] > kNoScale) Append(first, end - first, masks_[mask]);
    });
  }
  std::erase_if(masks_, [](const std::vector<Run>& runs) { return runs.empty(); });
}

void PixelsByMask::Append(int64_t first, int64_t count, std::vector<Run>& runs) {
  // A run holds no length: it is the difference of its end and that of the run before.
  const int64_t before = runs.empty() ? 0 : runs.back().end;
  const int64_t before_last = runs.size() < 2 ? 0 : runs[runs.size() - 2].end;
  if (!runs.empty() && runs.back().first + (before - before_last) == first) {
    runs.back().end += count;
  } else {
    runs.push_back({first, before + count});
  }
}

size_t PixelsByMask::Draw(std::mt19937_64& random) const {
  const std::vector<Run>& runs = masks_[DrawIndex(masks_.size(), random)];
  // The run that holds the mask's pixel number `place`, by binary search over the runs' ends.
  const auto place = static_cast<int64_t>(DrawIndex(static_cast<size_t>(runs.back().end), random));
  const auto run = std::upper_bound(runs.begin(), runs.end(), place,
                                    [](int64_t at, const Run& r) { return at < r.end; });
  const int64_t before = run == runs.begin() ? 0 : std::prev(run)->end;
  return static_cast<size_t>(run->first + (place - before));
}

}  // namespace pepeseg
