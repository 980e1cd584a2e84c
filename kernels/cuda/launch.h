#pragma once

#include <cstdint>

namespace pepeseg {

// Number of blocks of `block` threads (or elements) that cover `count`. It must be below 2^31, the
// limit of gridDim.x, and below 2^16 for gridDim.y.
inline int NumBlocks(int64_t count, int block) {
  return static_cast<int>((count + block - 1) / block);
}

}  // namespace pepeseg
