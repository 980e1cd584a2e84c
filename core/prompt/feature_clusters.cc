#include "core/prompt/feature_clusters.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "kernels/ops/render.h"

namespace pepeseg {
namespace {

constexpr int kNumRounds = 5;

float Dot(const float* a, const float* b) {
  return std::inner_product(a, a + kFeatureSize, b, 0.0f);
}

void Normalise(float* row) {
  const float norm = std::sqrt(Dot(row, row));
  if (norm <= 0) return;
  for (int k = 0; k < kFeatureSize; ++k) row[k] /= norm;
}

struct Nearest {
  size_t center = 0;
  float cosine = -2;
};
Nearest NearestOf(const float* unit, std::span<const float> centers) {
  Nearest best;
  for (size_t c = 0; c * kFeatureSize < centers.size(); ++c) {
    const float cosine = Dot(unit, &centers[c * kFeatureSize]);
    if (cosine > best.cosine) best = {c, cosine};
  }
  return best;
}

std::vector<float> MeanOf(std::span<const float> units) {
  std::vector<float> mean(kFeatureSize);
  for (size_t i = 0; i < units.size(); ++i) mean[i % kFeatureSize] += units[i];
  Normalise(mean.data());
  return mean;
}

// The mean, and what is farthest from all centres so far.
std::vector<float> FirstCenters(std::span<const float> units, int count) {
  std::vector<float> centers = MeanOf(units);
  for (int c = 1; c < count; ++c) {
    size_t farthest = 0;
    float least = 2;
    for (size_t i = 0; i < units.size(); i += kFeatureSize) {
      const float cosine = NearestOf(&units[i], centers).cosine;
      if (cosine < least) least = cosine, farthest = i;
    }
    const auto first = units.begin() + static_cast<int64_t>(farthest);
    centers.insert(centers.end(), first, first + kFeatureSize);
  }
  return centers;
}

// Moves each centre to the mean of what is nearest to it; returns how many that were.
std::vector<int> MoveCenters(std::span<const float> units, std::vector<float>& centers) {
  std::vector<float> sums(centers.size());
  std::vector<int> sizes(centers.size() / kFeatureSize);
  for (size_t i = 0; i < units.size(); i += kFeatureSize) {
    const size_t c = NearestOf(&units[i], centers).center;
    for (int k = 0; k < kFeatureSize; ++k) sums[c * kFeatureSize + k] += units[i + k];
    ++sizes[c];
  }
  for (size_t c = 0; c < sizes.size(); ++c) {
    if (sizes[c] == 0) continue;
    Normalise(&sums[c * kFeatureSize]);
    std::copy_n(&sums[c * kFeatureSize], kFeatureSize, &centers[c * kFeatureSize]);
  }
  return sizes;
}

}  // namespace

std::vector<float> ClusterDirections(std::span<const float> features, int count, double min_share) {
  std::vector<float> units(features.begin(), features.end());
  for (size_t i = 0; i < units.size(); i += kFeatureSize) Normalise(&units[i]);
  std::vector<float> centers = FirstCenters(units, count);
  std::vector<int> sizes;
  for (int round = 0; round < kNumRounds; ++round) sizes = MoveCenters(units, centers);
  std::vector<size_t> order(sizes.size());
  std::iota(order.begin(), order.end(), size_t{0});
  std::stable_sort(order.begin(), order.end(),
                   [&](size_t a, size_t b) { return sizes[a] > sizes[b]; });
  const size_t num_features = units.size() / kFeatureSize;
  const double least = min_share * static_cast<double>(num_features);
  std::vector<float> kept;
  for (const size_t c : order) {
    if (sizes[c] < least || sizes[c] == 0) continue;
    const auto first = centers.begin() + static_cast<int64_t>(c) * kFeatureSize;
    kept.insert(kept.end(), first, first + kFeatureSize);
  }
  return kept;
}

}  // namespace pepeseg
