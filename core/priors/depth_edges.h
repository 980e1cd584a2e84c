#pragma once

#include <cstdint>
#include <vector>

#include "core/scene/capture.h"

namespace pepeseg {

// Where the view's depth prior jumps (METHOD.md section 3, "boundary map"): Canny's edges of it,
// dilated by 5x5. [height, width], 1 there and where the prior knows nothing, else 0. The view must
// have a prior.
std::vector<uint8_t> DepthEdges(const View& view);

}  // namespace pepeseg
