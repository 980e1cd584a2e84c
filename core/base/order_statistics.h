#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <vector>

namespace pepeseg {

// All reorder the values. There must be at least one, and no NaN.

// Returns the value at a rank, from 0, of the sorted values.
template <typename T>
T ValueAtRank(std::vector<T>& values, size_t rank) {
  const auto at = values.begin() + static_cast<ptrdiff_t>(rank);
  std::nth_element(values.begin(), at, values.end());
  return *at;
}

// Returns the value at the rank nearest to a share of the sorted values; does not interpolate.
// share: in [0, 1].
template <typename T>
T NearestRank(std::vector<T>& values, double share) {
  const double rank = share * static_cast<double>(values.size() - 1);
  return ValueAtRank(values, static_cast<size_t>(std::lround(rank)));
}

// Returns the median; of an even number of values the larger of the two in the middle.
template <typename T>
T UpperMedian(std::vector<T>& values) {
  return ValueAtRank(values, values.size() / 2);
}

}  // namespace pepeseg
