#pragma once

#include <cassert>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>
#include <type_traits>
#include <utility>

namespace pepeseg {

class Backend;

// Raw memory of a backend, see the virtuals of Backend. Only Buffer calls these.
void* AllocateBytes(Backend& backend, size_t num_bytes);  // zero-filled; nullptr when out of memory
void FreeBytes(Backend& backend, void* data);
// As AllocateBytes, of Backend::AllocatePinned.
void* AllocatePinnedBytes(Backend& backend, size_t num_bytes);
void FreePinnedBytes(Backend& backend, void* data);
void CopyToBackend(Backend& backend, void* to, const void* from_host, size_t num_bytes);
void CopyToHost(Backend& backend, void* to_host, const void* from, size_t num_bytes);
void CopyInBackend(Backend& backend, void* to, const void* from, size_t num_bytes);
void ZeroBytes(Backend& backend, void* data, size_t num_bytes);

// Borrowed memory of a backend, `size` elements from `data` on. On CUDA the host must not access
// it. The owner must keep it alive until the ops that use it have run.
template <class T>
struct DeviceSpan {
  T* data = nullptr;
  int64_t size = 0;

  bool empty() const { return size == 0; }
  T& operator[](int64_t i) const { return data[i]; }
  // Implicit, as T* to const T* is.  NOLINTNEXTLINE(google-explicit-constructor)
  operator DeviceSpan<const T>() const { return {data, size}; }
  // Elements [first, first + count), which must lie within the span.
  DeviceSpan Subspan(int64_t first, int64_t count) const {
    assert(first >= 0 && count >= 0 && first + count <= size);
    return {data + first, count};
  }
};

// The memory of a buffer.
enum class MemoryPlace {
  kDevice,
  // Pinned memory of the host, which ops read in place, over the bus: for large inputs that a
  // device lacks the room for. Upload writes it at once, so that no op may be reading it then.
  kHost,
};

// Owns memory of a backend for `size()` trivially copyable elements. Movable. The backend must
// outlive it. Not thread safe.
//
// When memory runs out the buffer is empty and the backend keeps the error, see Backend.
template <class T>
class Buffer {
  static_assert(std::is_trivially_copyable_v<T>);

 public:
  // Empty, and of no backend until Reserve.
  Buffer() = default;
  // Zero-filled.
  Buffer(Backend& backend, int64_t size, MemoryPlace place = MemoryPlace::kDevice)
      : backend_(&backend), place_(place) {
    Resize(size);
  }
  // A copy of `host`.
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
    std::swap(place_, other.place_);
    return *this;
  }
  ~Buffer() { Free(); }

  // Sets the size, in elements. If it fits the capacity, memory and contents are kept. Otherwise
  // the contents are lost, and the new memory is zero. The buffer must have a backend.
  void Resize(int64_t size) {
    if (size > capacity_) {
      Free();
      const size_t num_bytes = static_cast<size_t>(size) * sizeof(T);
      data_ = static_cast<T*>(place_ == MemoryPlace::kDevice
                                  ? AllocateBytes(*backend_, num_bytes)
                                  : AllocatePinnedBytes(*backend_, num_bytes));
      capacity_ = data_ == nullptr ? 0 : size;
    }
    size_ = data_ == nullptr ? 0 : size;
  }
  // As Resize, but allocates a quarter more when it has to grow, for sizes that change from step to
  // step. Returns false, and leaves the buffer empty, when out of memory.
  bool Reserve(Backend& backend, int64_t size) {
    backend_ = &backend;
    if (size > capacity_) Resize(size + size / 4);
    Resize(size);
    return size_ == size;
  }
  // Sets all elements to 0.
  void Zero() {
    const size_t num_bytes = static_cast<size_t>(size_) * sizeof(T);
    if (num_bytes == 0) return;
    if (place_ == MemoryPlace::kHost) {
      std::memset(data_, 0, num_bytes);
    } else {
      ZeroBytes(*backend_, data_, num_bytes);
    }
  }
  // Copies `host` to the elements from `first` on. Copies nothing if the buffer got no memory.
  void Upload(std::span<const T> host, int64_t first = 0) {
    assert(data_ == nullptr || first + static_cast<int64_t>(host.size()) <= size_);
    if (data_ == nullptr || host.empty()) return;
    if (place_ == MemoryPlace::kHost) {
      std::memcpy(data_ + first, host.data(), host.size_bytes());
    } else {
      CopyToBackend(*backend_, data_ + first, host.data(), host.size_bytes());
    }
  }
  // Copies the elements from `first` on to `host`. Blocks until the ops that write them have run.
  // Copies nothing if the buffer got no memory.
  void Download(std::span<T> host, int64_t first = 0) const {
    assert(data_ == nullptr || first + static_cast<int64_t>(host.size()) <= size_);
    if (data_ == nullptr || host.empty()) return;
    if (place_ == MemoryPlace::kHost) {
      std::memcpy(host.data(), data_ + first, host.size_bytes());
    } else {
      CopyToHost(*backend_, host.data(), data_ + first, host.size_bytes());
    }
  }

  int64_t size() const { return size_; }
  // Largest size, in elements, that Resize takes without a new allocation.
  int64_t capacity() const { return capacity_; }
  bool empty() const { return size_ == 0; }
  DeviceSpan<T> span() { return {data_, size_}; }
  DeviceSpan<const T> span() const { return {data_, size_}; }

 private:
  void Free() {
    if (data_ == nullptr) return;
    if (place_ == MemoryPlace::kHost) {
      FreePinnedBytes(*backend_, data_);
    } else {
      FreeBytes(*backend_, data_);
    }
    data_ = nullptr;
  }

  Backend* backend_ = nullptr;
  T* data_ = nullptr;
  int64_t size_ = 0;
  int64_t capacity_ = 0;
  MemoryPlace place_ = MemoryPlace::kDevice;
};

// Returns the bytes of one element of each of the buffers together.
template <class... T>
constexpr int64_t BytesOfRow(const Buffer<T>&... /*buffers*/) {
  return static_cast<int64_t>((sizeof(T) + ...));
}

// Returns num_bytes with the slack that Buffer::Reserve may add.
constexpr int64_t WithReserve(int64_t num_bytes) { return num_bytes + num_bytes / 4; }

}  // namespace pepeseg
