#include "core/priors/sam/joined_masks.h"

#include <utility>
#include <vector>

namespace pepeseg {

MaskSet JoinMasks(const MaskSet& first, const MaskSet& second, std::span<const uint8_t> ignore,
                  double duplicate_iou) {
  MaskSetBuilder builder(first.width, first.height, duplicate_iou);
  for (const MaskSet* set : {&first, &second}) {
    for (int k = 0; k < set->num_masks; ++k) {
      const BinaryMask mask = set->Extract(k);
      std::vector<uint32_t> pixels;
      for (size_t i = 0; i < mask.pixels.size(); ++i) {
        const bool ignored = !ignore.empty() && ignore[i] != 0;
        if (mask.pixels[i] != 0 && !ignored) pixels.push_back(static_cast<uint32_t>(i));
      }
      builder.Add(pixels);
    }
  }
  return std::move(builder).Build();
}

}  // namespace pepeseg
