#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "core/scene/mask_set.h"

namespace pepeseg {

// The label vector of a patch at scale s (METHOD.md section 3), as a bitset over the view's masks:
// all masks smaller than s that cover it, and of those that are not smaller only the finest. Two
// pixels belong together at s iff their label vectors intersect. Masks without a scale take no
// part. patch_bits and out: [words].
void ScaleLabels(std::span<const uint64_t> patch_bits, std::span<const float> mask_scales,
                 float scale, std::span<uint64_t> out);

}  // namespace pepeseg
