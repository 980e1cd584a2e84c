#include "core/features/scale_labels.h"

#include <algorithm>
#include <bit>

#include "core/features/mask_scales.h"

namespace pepeseg {

void ScaleLabels(std::span<const uint64_t> patch_bits, std::span<const float> mask_scales,
                 float scale, std::span<uint64_t> out) {
  std::fill(out.begin(), out.end(), uint64_t{0});
  int finest = -1;  // of those not smaller; of equal ones the first
  for (size_t word = 0; word < patch_bits.size(); ++word) {
    for (uint64_t left = patch_bits[word]; left != 0; left &= left - 1) {
      const int mask = static_cast<int>(64 * word) + std::countr_zero(left);
      if (mask_scales[mask] <= kNoScale) continue;
      if (mask_scales[mask] < scale) {
        out[word] |= left & -left;
      } else if (finest < 0 || mask_scales[mask] < mask_scales[finest]) {
        finest = mask;
      }
    }
  }
  if (finest >= 0) out[finest / 64] |= uint64_t{1} << (finest % 64);
}

}  // namespace pepeseg
