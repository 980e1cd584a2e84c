#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <functional>
#include <vector>

namespace pepeseg {

// Returns d f / d x by central differences with Richardson extrapolation; the error is O(step^4).
inline std::vector<double> CentralDifferences(
    const std::function<double(const std::vector<double>&)>& f, std::vector<double> x,
    double step = 1e-3) {
  std::vector<double> gradient(x.size());
  for (size_t i = 0; i < x.size(); ++i) {
    const double at = x[i];
    const auto slope = [&](double h) {
      x[i] = at + h;
      const double above = f(x);
      x[i] = at - h;
      const double below = f(x);
      x[i] = at;
      return (above - below) / (2 * h);
    };
    gradient[i] = (4 * slope(step / 2) - slope(step)) / 3;
  }
  return gradient;
}

// Returns the norm of a - b over the norm of the larger of a and b, element by element. 0 if both
// are 0.
inline double RelativeError(const std::vector<double>& a, const std::vector<double>& b) {
  double difference = 0, norm = 0;
  for (size_t i = 0; i < a.size(); ++i) {
    difference += (a[i] - b[i]) * (a[i] - b[i]);
    norm += std::max(a[i] * a[i], b[i] * b[i]);
  }
  return norm == 0 ? 0 : std::sqrt(difference / norm);
}

}  // namespace pepeseg
