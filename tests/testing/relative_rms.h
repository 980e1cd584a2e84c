#pragma once

#include <cmath>
#include <cstddef>
#include <span>

namespace pepeseg::testing {

// Returns the root mean square of got - want, divided by that of `want`.
inline double RelativeRms(std::span<const float> got, std::span<const float> want) {
  double error = 0, sum = 0;
  for (size_t i = 0; i < want.size(); ++i) {
    const double x = static_cast<double>(want[i]), d = static_cast<double>(got[i]) - x;
    error += d * d;
    sum += x * x;
  }
  return std::sqrt(error / sum);
}

}  // namespace pepeseg::testing
