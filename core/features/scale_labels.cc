#include "core/features/scale_labels.h"

#include <algorithm>

#include "core/features/mask_scales.h"
#include "core/features/masks_of_patch.h"

namespace pepeseg {

void ScaleLabels(std::span<const uint64_t> patch_bits, std::span<const float> mask_scales,
                 float scale, std::span<uint64_t> out) {
  std::fill(out.begin(), out.end(), uint64_t{0});
  int finest = -1;  // of those not smaller; of equal ones the first
  const auto keep = [&](int mask) { out[mask / 64] |= uint64_t{1} << (mask % 64); };
  ForEachMaskIn(patch_bits, [&](int mask) {
    if (mask_scales[mask] <= kNoScale) return;
    if (mask_scales[mask] < scale) {
      keep(mask);
    } else if (finest < 0 || mask_scales[mask] < mask_scales[finest]) {
      finest = mask;
    }
  });
  if (finest >= 0) keep(finest);
}

}  // namespace pepeseg
