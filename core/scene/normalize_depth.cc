#include "core/scene/normalize_depth.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <iterator>

namespace pepeseg {
namespace {

constexpr double kLowPercentile = 0.1;
constexpr double kHighPercentile = 99.9;

// Partially sorts `known`, which is not empty.
float Percentile(std::vector<float>& known, double percent) {
  const auto rank =
      static_cast<ptrdiff_t>(std::lround(percent / 100 * (static_cast<double>(known.size()) - 1)));
  std::nth_element(known.begin(), known.begin() + rank, known.end());
  return known[static_cast<size_t>(rank)];
}

}  // namespace

std::vector<float> NormalizeDepth(std::vector<float> values) {
  std::vector<float> known;
  known.reserve(values.size());
  std::copy_if(values.begin(), values.end(), std::back_inserter(known),
               [](float value) { return !std::isnan(value); });
  if (known.empty()) return {};
  const float low = Percentile(known, kLowPercentile);
  const float range = Percentile(known, kHighPercentile) - low;
  if (!(range > 0) || !std::isfinite(range)) return {};
  for (float& value : values) {
    if (!std::isnan(value)) value = std::clamp((value - low) / range, 0.0f, 1.0f);
  }
  return values;
}

}  // namespace pepeseg
