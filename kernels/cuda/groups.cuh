#pragma once

#include <cstdint>

#include "kernels/buffer.h"

namespace pepeseg {

// The group that an element belongs to: first[group] <= i < first[group + 1].
__device__ inline int GroupOf(const DeviceSpan<const int32_t>& first, int64_t i) {
  int low = 0, high = static_cast<int>(first.size) - 1;
  while (low + 1 < high) {
    const int middle = (low + high) / 2;
    (first.data[middle] <= i ? low : high) = middle;
  }
  return low;
}

}  // namespace pepeseg
