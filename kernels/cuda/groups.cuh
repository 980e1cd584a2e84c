#pragma once

#include <cstdint>

#include "kernels/buffer.h"

namespace pepeseg {

// Returns the group of an element: first[group] <= i < first[group + 1]. `first` is ascending, with
// one element more than there are groups, and first[0] <= i. Binary search.
__device__ inline int GroupOf(const DeviceSpan<const int32_t>& first, int64_t i) {
  int low = 0, high = static_cast<int>(first.size) - 1;
  while (low + 1 < high) {
    const int middle = (low + high) / 2;
    (first.data[middle] <= i ? low : high) = middle;
  }
  return low;
}

}  // namespace pepeseg
