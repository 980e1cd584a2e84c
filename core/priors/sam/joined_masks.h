#pragma once

#include <cstdint>
#include <span>

#include "core/scene/mask_set.h"

namespace pepeseg {

// The masks of `first`, then those of `second`, without the pixels that `ignore` marks: [height,
// width], non-zero is left out; empty: none is. A mask whose IoU with one before it is over
// `duplicate_iou` is dropped, as is one without a pixel. `second` may have no size and no masks.
MaskSet JoinMasks(const MaskSet& first, const MaskSet& second, std::span<const uint8_t> ignore,
                  double duplicate_iou);

}  // namespace pepeseg
