#include "core/features/pixels_by_mask.h"

#include <algorithm>
#include <bit>

#include "core/features/mask_scales.h"
#include "core/features/random_draws.h"

namespace pepeseg {

PixelsByMask::PixelsByMask(const MaskSet& masks, std::span<const float> mask_scales,
                           std::span<const int32_t> pixels)
    : pixels_(pixels.begin(), pixels.end()) {
  const auto patch_of = [&](int32_t pixel) { return masks.pixel_patch[pixel]; };
  std::stable_sort(pixels_.begin(), pixels_.end(),
                   [&](int32_t a, int32_t b) { return patch_of(a) < patch_of(b); });
  masks_.resize(mask_scales.size());
  const auto size = static_cast<int64_t>(pixels_.size());
  for (int64_t first = 0, end = 0; first < size; first = end) {
    const auto patch = static_cast<size_t>(patch_of(pixels_[first]));
    while (end < size && static_cast<size_t>(patch_of(pixels_[end])) == patch) ++end;
    for (int word = 0; word < masks.words; ++word) {
      uint64_t left = masks.patch_bits[patch * masks.words + word];
      for (; left != 0; left &= left - 1) {
        const int mask = 64 * word + std::countr_zero(left);
        if (mask_scales[mask] <= kNoScale) continue;
        std::vector<Run>& runs = masks_[mask];
        const int64_t before = runs.empty() ? 0 : runs.back().end;
        runs.push_back({static_cast<int32_t>(first), before + end - first});
      }
    }
  }
  std::erase_if(masks_, [](const std::vector<Run>& runs) { return runs.empty(); });
}

int32_t PixelsByMask::Draw(std::mt19937_64& random) const {
  const std::vector<Run>& runs = masks_[DrawIndex(masks_.size(), random)];
  const auto place = static_cast<int64_t>(DrawIndex(static_cast<size_t>(runs.back().end), random));
  const auto run = std::upper_bound(runs.begin(), runs.end(), place,
                                    [](int64_t at, const Run& r) { return at < r.end; });
  const int64_t before = run == runs.begin() ? 0 : std::prev(run)->end;
  return pixels_[run->first + (place - before)];
}

}  // namespace pepeseg
