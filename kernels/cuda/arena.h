#pragma once

#include <cstddef>
#include <cstdint>

namespace pepeseg {

// Cuts one block of memory into arrays. Without a base it only adds up their sizes, so that one
// function that takes them both sizes the block and lays it out.
class Arena {
 public:
  explicit Arena(void* base = nullptr) : base_(static_cast<std::byte*>(base)) {}

  template <class T>
  T* Take(int64_t count) {
    constexpr size_t kAlign = 256;
    std::byte* at = base_ == nullptr ? nullptr : base_ + num_bytes_;
    num_bytes_ += (static_cast<size_t>(count) * sizeof(T) + kAlign - 1) / kAlign * kAlign;
    return reinterpret_cast<T*>(at);
  }
  size_t num_bytes() const { return num_bytes_; }

 private:
  std::byte* base_;
  size_t num_bytes_ = 0;
};

}  // namespace pepeseg
