#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <vector>

namespace pepeseg {

// Both reorder the values. There must be at least one, and no NaN.

// Returns the value at the rank nearest to a share of the sorted values; does not interpolate.
// share: in [0, 1].
template <typename T>
T NearestRank(std::vector<T>& values, double share) {
  const auto at = values.begin() + std::lround(share * static_cast<double>(values.size() - 1));
  std::nth_element(values.begin(), at, values.end());
  return *at;
}

// Returns the median; of an even number of values the larger of the two in the middle.
template <typename T>
T UpperMedian(std::vector<T>& values) {
  const auto middle = values.begin() + static_cast<ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

}  // namespace pepeseg
