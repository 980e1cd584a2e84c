#pragma once

#include <cstdint>

namespace pepeseg {

inline int NumBlocks(int64_t count, int block) {
  return static_cast<int>((count + block - 1) / block);
}

}  // namespace pepeseg
