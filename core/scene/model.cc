#include "core/scene/model.h"

#include <algorithm>
#include <cmath>

#include "kernels/math/feature.h"
#include "kernels/math/gate.h"
#include "kernels/ops/render.h"

namespace pepeseg {

int64_t LargestView(const std::vector<ModelView>& views) {
  int64_t largest = 0;
  for (const ModelView& view : views) {
    largest = std::max(largest, int64_t{view.camera.width} * view.camera.height);
  }
  return largest;
}

double QuantileOfScale(const FeatureField& field, double scene_units) {
  const std::vector<float>& knots = field.scale_quantiles;
  if (knots.empty() || scene_units <= knots.front()) return 0;
  if (scene_units >= knots.back()) return 1;
  // Here knots.front() < scene_units < knots.back(). The first knot >= scene_units. The knot before
  // it is smaller, so `high - low` is not 0.
  const auto above = std::lower_bound(knots.begin(), knots.end(), scene_units);
  const double high = *above;
  const double low = *(above - 1);
  const double position =
      static_cast<double>(above - knots.begin()) - (high - scene_units) / (high - low);
  return position / static_cast<double>(knots.size() - 1);
}

double ScaleOfQuantile(const FeatureField& field, double quantile) {
  const std::vector<float>& knots = field.scale_quantiles;
  if (knots.empty()) return 0;
  const double position = std::clamp(quantile, 0.0, 1.0) * static_cast<double>(knots.size() - 1);
  const auto low = static_cast<size_t>(position);
  const size_t high = std::min(low + 1, knots.size() - 1);
  return std::lerp(static_cast<double>(knots[low]), static_cast<double>(knots[high]),
                   position - static_cast<double>(low));
}

void PsiAt(std::span<const float> gate, float scale, float* psi) {
  GateAt(GateNumbers<float>{gate.data(), static_cast<int64_t>(gate.size())}, kFeatureSize, scale,
         psi);
}

// METHOD.md section 3: the cosine of two features at a scale is the dot product of their units.
std::vector<float> GatedUnits(std::span<const float> features, std::span<const float> gate,
                              float scale) {
  float psi[kFeatureSize];
  PsiAt(gate, scale, psi);
  std::vector<float> units(features.size());
  for (size_t i = 0; i < features.size(); i += kFeatureSize) {
    GatedUnit(psi, features.data() + i, kFeatureSize, units.data() + i);
  }
  return units;
}

// The mean of psi * f / |psi * f| is psi times the mean of f / |psi * f|.
std::vector<float> GatedMean(std::span<const float> features, std::span<const float> gate,
                             float scale) {
  float psi[kFeatureSize];
  PsiAt(gate, scale, psi);
  double sums[kFeatureSize] = {};
  for (size_t i = 0; i < features.size(); i += kFeatureSize) {
    double squares = 0;
    for (int k = 0; k < kFeatureSize; ++k) {
      const double gated = double{psi[k]} * features[i + k];
      squares += gated * gated;
    }
    if (squares == 0) continue;
    for (int k = 0; k < kFeatureSize; ++k) sums[k] += features[i + k] / std::sqrt(squares);
  }
  double squares = 0;
  for (const double sum : sums) squares += sum * sum;
  std::vector<float> mean(kFeatureSize);
  if (squares == 0) return mean;
  for (int k = 0; k < kFeatureSize; ++k) {
    mean[k] = static_cast<float>(sums[k] / std::sqrt(squares));
  }
  return mean;
}

}  // namespace pepeseg
