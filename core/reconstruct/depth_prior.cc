#include "core/reconstruct/depth_prior.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace pepeseg {

std::vector<float> ShrinkPrior(const View& view, int factor) {
  if (factor == 1) return view.depth.values;
  const int width = view.camera.width / factor, height = view.camera.height / factor;
  const auto size = static_cast<size_t>(width) * height;
  std::vector<float> sum(size, 0), count(size, 0);
  for (int y = 0; y < height * factor; ++y) {
    for (int x = 0; x < width * factor; ++x) {
      const float value = view.depth.values[static_cast<size_t>(y) * view.camera.width + x];
      if (std::isnan(value)) continue;
      const size_t block = static_cast<size_t>(y / factor) * width + x / factor;
      sum[block] += value;
      ++count[block];
    }
  }
  for (size_t i = 0; i < size; ++i) {
    sum[i] = count[i] > 0 ? sum[i] / count[i] : std::numeric_limits<float>::quiet_NaN();
  }
  return sum;
}

PriorBounds InlierBounds(std::span<const float> prior) {
  constexpr double kShare = 0.01;  // of the known values, at either end
  std::vector<float> known;
  std::ranges::copy_if(prior, std::back_inserter(known), [](float v) { return !std::isnan(v); });
  const auto percentile = [&](double share) {
    const auto at = std::lround(share * static_cast<double>(known.size() - 1));
    std::nth_element(known.begin(), known.begin() + at, known.end());
    return known[at];
  };
  const float min = percentile(kShare);
  return {min, percentile(1 - kShare)};
}

// Two passes: the mean first, then the mean distance from it.
double MeanDeviation(std::span<const float> prior, const PriorBounds& bounds) {
  const auto mean = [&](auto of) {
    double sum = 0, num = 0;
    for (const float value : prior) {
      if (!(value >= bounds.min && value <= bounds.max)) continue;  // NaN: unknown
      sum += of(value);
      ++num;
    }
    return num > 0 ? sum / num : 0.0;
  };
  const double center = mean([](float value) { return double{value}; });
  return mean([center](float value) { return std::abs(value - center); });
}

}  // namespace pepeseg
