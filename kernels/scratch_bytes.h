#pragma once

#include <cstdint>

#include "kernels/buffer.h"

namespace pepeseg {

// Returns the bytes of one element of each of the buffers together.
template <class... T>
constexpr int64_t BytesOfRow(const Buffer<T>&... /*buffers*/) {
  return static_cast<int64_t>((sizeof(T) + ...));
}

// Returns num_bytes with the slack that Buffer::Reserve may add.
constexpr int64_t WithReserve(int64_t num_bytes) { return num_bytes + num_bytes / 4; }

}  // namespace pepeseg
