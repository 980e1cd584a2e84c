#include "tests/kernels/tree_reference.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <random>
#include <tuple>

#include "kernels/ops/render.h"

namespace pepeseg {
namespace {

constexpr double kFarApart = std::numeric_limits<double>::infinity();

// Infinite unless it is a finite number.
double SquaredDistance(const std::vector<float>& points, int a, int b) {
  double sum = 0;
  for (int k = 0; k < kFeatureSize; ++k) {
    const double difference = static_cast<double>(points[a * kFeatureSize + k]) -
                              static_cast<double>(points[b * kFeatureSize + k]);
    sum += difference * difference;
  }
  return std::isfinite(sum) ? sum : kFarApart;
}

// Squared distance to the min_samples-th nearest point, where the point itself is the first.
double CoreOf(const std::vector<float>& points, int count, int point, int min_samples) {
  std::vector<double> squared = {0};  // to itself
  for (int other = 0; other < count; ++other) {
    if (other != point) squared.push_back(SquaredDistance(points, point, other));
  }
  std::sort(squared.begin(), squared.end());
  return min_samples <= count ? squared[min_samples - 1] : kFarApart;
}

}  // namespace

ReferenceTree ReferenceSpanningTree(const std::vector<float>& points, int min_samples) {
  const int count = static_cast<int>(points.size()) / kFeatureSize;
  ReferenceTree tree;
  for (int point = 0; point < count; ++point) {
    tree.core_squared.push_back(CoreOf(points, count, point, min_samples));
  }
  std::vector<ReferenceEdge> edges;
  for (int a = 0; a < count; ++a) {
    for (int b = a + 1; b < count; ++b) {
      const double cores = std::max(tree.core_squared[a], tree.core_squared[b]);
      edges.push_back({std::max(cores, SquaredDistance(points, a, b)), a, b});
    }
  }
  std::sort(edges.begin(), edges.end(), [](const ReferenceEdge& x, const ReferenceEdge& y) {
    return std::tie(x.squared, x.a, x.b) < std::tie(y.squared, y.a, y.b);
  });
  // Kruskal: an edge is in the tree if it joins two components.
  std::vector<int> component(count);
  std::iota(component.begin(), component.end(), 0);
  for (const ReferenceEdge& edge : edges) {
    const int from = component[edge.a], to = component[edge.b];
    if (from == to) continue;
    std::replace(component.begin(), component.end(), from, to);
    tree.edges.push_back(edge);
  }
  return tree;
}

std::vector<float> LatticePoints(int count, int num_channels, int range, uint64_t seed) {
  std::mt19937_64 random(seed);
  std::vector<float> points(static_cast<size_t>(count) * kFeatureSize);
  for (int point = 0; point < count; ++point) {
    for (int k = 0; k < num_channels; ++k) {
      points[point * kFeatureSize + k] = static_cast<float>(random() % range);
    }
  }
  return points;
}

std::vector<float> ClusteredPoints(int count, int num_clusters, float spread, uint64_t seed) {
  std::mt19937_64 random(seed);
  std::normal_distribution<float> normal;
  std::vector<float> centres(static_cast<size_t>(num_clusters) * kFeatureSize);
  for (float& value : centres) value = normal(random);
  std::vector<float> points(static_cast<size_t>(count) * kFeatureSize);
  for (int point = 0; point < count; ++point) {
    const int cluster = static_cast<int>(random() % num_clusters);
    float* at = points.data() + static_cast<int64_t>(point) * kFeatureSize;
    float squares = 0;
    for (int k = 0; k < kFeatureSize; ++k) {
      // Every tenth point is noise.
      at[k] = point % 10 == 0 ? normal(random)
                              : centres[cluster * kFeatureSize + k] + spread * normal(random);
      squares += at[k] * at[k];
    }
    for (int k = 0; k < kFeatureSize; ++k) at[k] /= std::sqrt(squares);
  }
  return points;
}

}  // namespace pepeseg
