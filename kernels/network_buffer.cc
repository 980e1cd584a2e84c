#include "kernels/network_buffer.h"

#include <algorithm>

namespace pepeseg {

NetworkBuffer::NetworkBuffer(Backend& backend, Precision precision, std::span<const float> values)
    : NetworkBuffer(backend, precision, static_cast<int64_t>(values.size())) {
  Upload(values);
}

void NetworkBuffer::Upload(std::span<const float> values, int64_t first) {
  if (precision_ == Precision::kFloat) {
    bytes_.Upload(std::as_bytes(values), first * BytesOf(precision_));
    return;
  }
  std::vector<Half> halves(values.size());
  std::ranges::transform(values, halves.begin(), HalfFromFloat);
  bytes_.Upload(std::as_bytes(std::span<const Half>(halves)), first * BytesOf(precision_));
}

std::vector<float> NetworkBuffer::Download() const {
  std::vector<float> values(size());
  if (precision_ == Precision::kFloat) {
    bytes_.Download(std::as_writable_bytes(std::span(values)));
    return values;
  }
  std::vector<Half> halves(values.size());
  bytes_.Download(std::as_writable_bytes(std::span(halves)));
  std::ranges::transform(halves, values.begin(), FloatFromHalf);
  return values;
}

void NetworkBuffer::UploadHalves(std::span<const Half> values) {
  if (precision_ == Precision::kHalf) {
    bytes_.Upload(std::as_bytes(values), 0);
    return;
  }
  std::vector<float> floats(values.size());
  std::ranges::transform(values, floats.begin(), FloatFromHalf);
  Upload(floats);
}

std::vector<Half> NetworkBuffer::DownloadHalves() const {
  std::vector<Half> halves(size());
  if (precision_ == Precision::kHalf) {
    bytes_.Download(std::as_writable_bytes(std::span(halves)));
    return halves;
  }
  std::ranges::transform(Download(), halves.begin(), HalfFromFloat);
  return halves;
}

}  // namespace pepeseg
