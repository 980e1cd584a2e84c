#include "core/scene/model.h"

#include <algorithm>
#include <cmath>

namespace pepeseg {

double QuantileOfScale(const FeatureField& field, double scene_units) {
  const std::vector<float>& knots = field.scale_quantiles;
  if (knots.size() < 2) return 0;
  const double last = static_cast<double>(knots.size() - 1);
  // The empirical CDF at a repeated knot is that of its last copy.
  const auto above = std::upper_bound(knots.begin(), knots.end(), scene_units);
  if (above == knots.begin()) return 0;
  if (above == knots.end()) return 1;
  const double low = *(above - 1), high = *above;
  const double index = static_cast<double>(above - knots.begin() - 1);
  return (index + (scene_units - low) / (high - low)) / last;
}

double ScaleOfQuantile(const FeatureField& field, double quantile) {
  const std::vector<float>& knots = field.scale_quantiles;
  if (knots.empty()) return 0;
  const double position = std::clamp(quantile, 0.0, 1.0) * static_cast<double>(knots.size() - 1);
  const auto index = std::min(static_cast<size_t>(position), knots.size() - 1);
  const size_t next = std::min(index + 1, knots.size() - 1);
  return std::lerp(static_cast<double>(knots[index]), static_cast<double>(knots[next]),
                   position - static_cast<double>(index));
}

}  // namespace pepeseg
