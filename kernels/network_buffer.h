#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "kernels/buffer.h"
#include "kernels/half.h"

// Values of neural networks: activations and weights, in one of two formats that is chosen when the
// program runs.
namespace pepeseg {

enum class Precision : uint8_t {
  kFloat,  // stored as float and multiplied to about the precision of float
  kHalf,   // stored as Half, multiplied as Half, added as float. CUDA only
};
constexpr int64_t BytesOf(Precision precision) { return precision == Precision::kHalf ? 2 : 4; }

// Borrowed memory of a backend for `size` floats or Halves, see DeviceSpan.
struct NetworkSpan {
  void* data = nullptr;
  int64_t size = 0;
  Precision precision = Precision::kFloat;

  bool empty() const { return size == 0; }
  // Elements [first, first + count), which must lie within the span.
  NetworkSpan Subspan(int64_t first, int64_t count) const {
    return {static_cast<std::byte*>(data) + first * BytesOf(precision), count, precision};
  }
};
struct ConstNetworkSpan {
  const void* data = nullptr;
  int64_t size = 0;
  Precision precision = Precision::kFloat;

  ConstNetworkSpan() = default;
  ConstNetworkSpan(const void* data_in, int64_t size_in, Precision precision_in)
      : data(data_in), size(size_in), precision(precision_in) {}
  // Implicit, as T* to const T* is.  NOLINTNEXTLINE(google-explicit-constructor)
  ConstNetworkSpan(const NetworkSpan& span)
      : data(span.data), size(span.size), precision(span.precision) {}

  bool empty() const { return size == 0; }
  ConstNetworkSpan Subspan(int64_t first, int64_t count) const {
    return {static_cast<const std::byte*>(data) + first * BytesOf(precision), count, precision};
  }
};

// Owns memory of a backend for values of a network, as Buffer does. Movable. The backend must
// outlive it. Not thread safe.
class NetworkBuffer {
 public:
  // Empty, and of no backend.
  NetworkBuffer() = default;
  // Zero-filled.
  NetworkBuffer(Backend& backend, Precision precision, int64_t size)
      : precision_(precision), bytes_(backend, size * BytesOf(precision)) {}
  // A copy of `values`, rounded to the precision.
  NetworkBuffer(Backend& backend, Precision precision, std::span<const float> values);

  // As Buffer::Resize.
  void Resize(int64_t size) { bytes_.Resize(size * BytesOf(precision_)); }
  // Copies `values`, rounded to the precision, to the elements from `first` on.
  void Upload(std::span<const float> values, int64_t first = 0);
  // Copies `values`, as floats if the precision is that, to the first elements.
  void UploadHalves(std::span<const Half> values);
  // Returns all values. Blocks until the ops that write them have run. Zeros if the buffer got no
  // memory.
  std::vector<float> Download() const;
  // Returns them as Halves: the stored ones, or floats rounded.
  std::vector<Half> DownloadHalves() const;

  int64_t size() const { return bytes_.size() / BytesOf(precision_); }
  Precision precision() const { return precision_; }
  NetworkSpan span() { return {bytes_.span().data, size(), precision_}; }
  ConstNetworkSpan span() const { return {bytes_.span().data, size(), precision_}; }

 private:
  Precision precision_ = Precision::kFloat;
  Buffer<std::byte> bytes_;
};

}  // namespace pepeseg
