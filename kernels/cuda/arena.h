#pragma once

#include <cstddef>
#include <cstdint>

namespace pepeseg {

// Cuts one block of memory into arrays, each at a multiple of 256 bytes. Without a base it only
// adds up the sizes and returns null pointers, so that one function can both size the block (a
// first call on an empty arena) and lay it out (a second call on the block). `base` must be
// 256-byte aligned.
class Arena {
 public:
  explicit Arena(void* base = nullptr) : base_(static_cast<std::byte*>(base)) {}

  // Returns the next `count` elements, uninitialised.
  template <class T>
  T* Take(int64_t count) {
    constexpr size_t kAlign = 256;
    std::byte* at = base_ == nullptr ? nullptr : base_ + num_bytes_;
    num_bytes_ += (static_cast<size_t>(count) * sizeof(T) + kAlign - 1) / kAlign * kAlign;
    return reinterpret_cast<T*>(at);
  }
  // Bytes taken so far, padding included.
  size_t num_bytes() const { return num_bytes_; }

 private:
  std::byte* base_;
  size_t num_bytes_ = 0;
};

}  // namespace pepeseg
