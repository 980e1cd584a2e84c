#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <vector>

#include "kernels/half.h"
#include "kernels/network_buffer.h"
#include "kernels/ops/prompt_network.h"

namespace pepeseg {

// The values of a ConstNetworkSpan as floats: in place, or converted from halves.
class Factors {
 public:
  explicit Factors(const ConstNetworkSpan& span) : data_(static_cast<const float*>(span.data)) {
    if (span.precision == Precision::kFloat || span.empty()) return;
    const auto* halves = static_cast<const Half*>(span.data);
    converted_.resize(static_cast<size_t>(span.size));
    std::transform(halves, halves + span.size, converted_.begin(), FloatFromHalf);
    data_ = converted_.data();
  }
  const float* data() const { return data_; }

 private:
  std::vector<float> converted_;
  const float* data_;
};

// Writes value i, rounded where the span has halves.
inline void Store(const NetworkSpan& span, int64_t i, float value) {
  if (span.precision == Precision::kFloat) {
    static_cast<float*>(span.data)[i] = value;
  } else {
    static_cast<Half*>(span.data)[i] = HalfFromFloat(value);
  }
}

// Writes values from `first` on.
inline void StoreAll(const NetworkSpan& span, int64_t first, const float* values, int64_t count) {
  if (span.precision == Precision::kFloat) {
    std::copy_n(values, count, static_cast<float*>(span.data) + first);
  } else {
    for (int64_t i = 0; i < count; ++i) Store(span, first + i, values[i]);
  }
}

// Returns a . b.
inline float Dot(const float* a, const float* b, int size) {
  // Eight sums, so that the compiler can use vectors; their number sets the order of additions.
  float sum[8] = {};
  for (int i = 0; i < size; i += 8) {
    for (int k = 0; k < 8; ++k) sum[k] += a[i + k] * b[i + k];
  }
  return ((sum[0] + sum[4]) + (sum[1] + sum[5])) + ((sum[2] + sum[6]) + (sum[3] + sum[7]));
}

// Normalises x in place, see PromptNorm.
inline void Normalize(const PromptNorm& norm, int size, float epsilon, float* x) {
  float mean = 0, variance = 0;
  for (int i = 0; i < size; ++i) mean += x[i];
  mean /= static_cast<float>(size);
  for (int i = 0; i < size; ++i) variance += (x[i] - mean) * (x[i] - mean);
  variance /= static_cast<float>(size);
  const float inverse = 1 / std::sqrt(variance + epsilon);
  for (int i = 0; i < size; ++i) {
    x[i] = (x[i] - mean) * inverse * norm.scale[i] + norm.shift[i];
  }
}

}  // namespace pepeseg
