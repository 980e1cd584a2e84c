#pragma once

#include <cassert>
#include <cstddef>
#include <cstdint>
#include <span>
#include <type_traits>
#include <utility>

namespace pepeseg {

class Backend;

// Raw memory of a backend; only Buffer calls these (buffer.cc forwards them to the Backend).
void* AllocateBytes(Backend& backend, size_t num_bytes);  // zero-filled; nullptr when out of memory
void FreeBytes(Backend& backend, void* data);
void CopyToBackend(Backend& backend, void* to, const void* from_host, size_t num_bytes);
void CopyToHost(Backend& backend, void* to_host, const void* from, size_t num_bytes);
void CopyInBackend(Backend& backend, void* to, const void* from, size_t num_bytes);
void ZeroBytes(Backend& backend, void* data, size_t num_bytes);

// Borrowed memory of a backend: on CUDA the pointer must not be read on the host.
template <class T>
struct DeviceSpan {
  T* data = nullptr;
  int64_t size = 0;

  bool empty() const { return size == 0; }
  T& operator[](int64_t i) const { return data[i]; }
  // Implicit as T* to const T* is.  NOLINTNEXTLINE(google-explicit-constructor)
  operator DeviceSpan<const T>() const { return {data, size}; }
  DeviceSpan Subspan(int64_t first, int64_t count) const {
    assert(first >= 0 && count >= 0 && first + count <= size);
    return {data + first, count};
  }
};

// Owns memory of a backend for `size()` trivially copyable elements. Movable; the backend must
// outlive it. Not thread safe.
template <class T>
class Buffer {
  static_assert(std::is_trivially_copyable_v<T>);

 public:
  Buffer() = default;
  Buffer(Backend& backend, int64_t size) : backend_(&backend) { Resize(size); }
  Buffer(Backend& backend, std::span<const T> host)
      : Buffer(backend, static_cast<int64_t>(host.size())) {
    Upload(host);
  }
  Buffer(Buffer&& other) noexcept { *this = std::move(other); }
  Buffer& operator=(Buffer&& other) noexcept {
    std::swap(backend_, other.backend_);
    std::swap(data_, other.data_);
    std::swap(size_, other.size_);
    std::swap(capacity_, other.capacity_);
    return *this;
  }
  ~Buffer() {
    if (data_ != nullptr) FreeBytes(*backend_, data_);
  }

  // Makes room for `size` elements. The contents are kept when it shrinks or still fits, and are
  // lost (new memory is zero) when it has to grow beyond what was ever asked for.
  void Resize(int64_t size) {
    if (size > capacity_) {
      if (data_ != nullptr) FreeBytes(*backend_, data_);
      data_ = static_cast<T*>(AllocateBytes(*backend_, static_cast<size_t>(size) * sizeof(T)));
      capacity_ = data_ == nullptr ? 0 : size;
    }
    size_ = data_ == nullptr ? 0 : size;
  }
  // As Resize, but leaves slack when it has to grow: for sizes that change from step to step.
  // False, and empty, when out of memory.
  bool Reserve(Backend& backend, int64_t size) {
    backend_ = &backend;
    if (size > capacity_) Resize(size + size / 4);
    Resize(size);
    return size_ == size;
  }
  void Zero() {
    if (size_ > 0) ZeroBytes(*backend_, data_, static_cast<size_t>(size_) * sizeof(T));
  }
  // Nothing is copied to or from a buffer that got no memory.
  void Upload(std::span<const T> host, int64_t first = 0) {
    assert(data_ == nullptr || first + static_cast<int64_t>(host.size()) <= size_);
    if (data_ != nullptr && !host.empty())
      CopyToBackend(*backend_, data_ + first, host.data(), host.size_bytes());
  }
  // Waits for the work that writes this memory.
  void Download(std::span<T> host, int64_t first = 0) const {
    assert(data_ == nullptr || first + static_cast<int64_t>(host.size()) <= size_);
    if (data_ != nullptr && !host.empty())
      CopyToHost(*backend_, host.data(), data_ + first, host.size_bytes());
  }

  int64_t size() const { return size_; }
  int64_t capacity() const { return capacity_; }  // the largest size that Resize keeps in place
  bool empty() const { return size_ == 0; }
  DeviceSpan<T> span() { return {data_, size_}; }
  DeviceSpan<const T> span() const { return {data_, size_}; }

 private:
  Backend* backend_ = nullptr;
  T* data_ = nullptr;
  int64_t size_ = 0;
  int64_t capacity_ = 0;
};

}  // namespace pepeseg
