#pragma once

#include <cstdint>

#include "kernels/buffer.h"

namespace pepeseg {

// Bytes of one element of each of the buffers.
template <class... T>
constexpr int64_t BytesOfRow(const Buffer<T>&... /*buffers*/) {
  return static_cast<int64_t>((sizeof(T) + ...));
}

// As Buffer::Reserve may leave it.
constexpr int64_t WithReserve(int64_t num_bytes) { return num_bytes + num_bytes / 4; }

}  // namespace pepeseg
