#pragma once

#include <cstdint>

#include "kernels/buffer.h"

namespace pepeseg {

// Sets the size as Buffer::Reserve does, but allocates without slack: for rows and columns, of
// which there are many and whose sizes do not change. Contents are lost when the buffer grows.
template <class T>
void Fit(Backend& backend, int64_t size, Buffer<T>& buffer) {
  if (size > buffer.capacity()) buffer = Buffer<T>(backend, size);
  buffer.Resize(size);
}

}  // namespace pepeseg
