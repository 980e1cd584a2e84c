// Compares HDBSCAN with a naive implementation of its definition, on many small random inputs.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <memory>
#include <random>

#include "core/cluster/hdbscan.h"
#include "tests/testing/status_testing.h"

namespace pepeseg {
namespace {

using Matrix = std::vector<std::vector<double>>;
using Points = std::vector<int>;

// Returns the mutual reachability of all pairs. It is exact between points of integers.
Matrix MutualReachability(const std::vector<float>& points, int min_samples) {
  const size_t count = points.size() / kFeatureSize;
  Matrix distance(count, std::vector<double>(count));
  for (size_t a = 0; a < count; ++a) {
    for (size_t b = 0; b < count; ++b) {
      double sum = 0;
      for (int k = 0; k < kFeatureSize; ++k) {
        sum += std::pow(static_cast<double>(points[a * kFeatureSize + k]) -
                            static_cast<double>(points[b * kFeatureSize + k]),
                        2);
      }
      distance[a][b] = std::sqrt(sum);
    }
  }
  std::vector<double> core;
  for (std::vector<double> distances : distance) {
    std::sort(distances.begin(), distances.end());
    core.push_back(distances[min_samples - 1]);
  }
  for (size_t a = 0; a < count; ++a) {
    for (size_t b = 0; b < count; ++b) {
      distance[a][b] = std::max({distance[a][b], core[a], core[b]});
    }
  }
  return distance;
}

// Returns the components of the graph of the pairs that are closer than `level`.
std::vector<Points> ComponentsBelow(const Matrix& reach, Points points, double level) {
  std::vector<Points> components;
  while (!points.empty()) {
    Points component = {points.back()};
    points.pop_back();
    for (size_t i = 0; i < component.size(); ++i) {
      const auto near = [&](int other) { return reach[component[i]][other] < level; };
      std::copy_if(points.begin(), points.end(), std::back_inserter(component), near);
      points.erase(std::remove_if(points.begin(), points.end(), near), points.end());
    }
    components.push_back(component);
  }
  return components;
}

// A cluster.
struct Node {
  Points points;
  double stability = 0, end = 0;  // end: the lambda at which it ends
  std::vector<double> left;       // by point of the input: the lambda at which it leaves, or 0
  std::vector<std::unique_ptr<Node>> children;
};

struct Search {
  const Matrix& reach;
  std::vector<double> levels;  // all distances, descending
  size_t min_cluster_size;

  // Returns the cluster of these points, which begins at the lambda `birth`, with all below it.
  // level: index of the next level.
  std::unique_ptr<Node> Explore(const Points& points, double birth, size_t level) const {
    auto node = std::make_unique<Node>();
    node->points = points;
    node->left.resize(reach.size());
    Points alive = points;
    while (true) {
      const double lambda = 1 / levels[level];
      std::vector<Points> large;
      for (Points& component : ComponentsBelow(reach, alive, levels[level++])) {
        if (component.size() >= min_cluster_size) large.push_back(std::move(component));
      }
      const bool lives_on = large.size() == 1;
      for (const int point : alive) {
        const auto& stay = large.empty() ? Points() : large[0];
        if (lives_on && std::find(stay.begin(), stay.end(), point) != stay.end()) continue;
        node->left[point] = lambda;
        node->stability += lambda - birth;
      }
      if (lives_on) {
        alive = large[0];
        continue;
      }
      node->end = lambda;
      for (const Points& child : large) node->children.push_back(Explore(child, lambda, level));
      return node;
    }
  }
};

// Returns the stability of the best choice at or below a cluster, and the choice.
std::pair<double, std::vector<const Node*>> Best(const Node& node, bool may_be_itself) {
  double sum = 0;
  std::vector<const Node*> chosen;
  for (const auto& child : node.children) {
    const auto [stability, below] = Best(*child, true);
    sum += stability;
    chosen.insert(chosen.end(), below.begin(), below.end());
  }
  if (!may_be_itself || sum > node.stability) return {sum, chosen};
  return {node.stability, {&node}};
}

// Returns the clusters of HDBSCAN, computed from its definition: from the sparsest level to the
// densest one, with the components of the graph of all pairs at each level. points: [n, 32], all
// finite.
Clusters NaiveHdbscan(const std::vector<float>& points, int min_cluster_size, int min_samples) {
  const Matrix reach = MutualReachability(points, min_samples);
  Search search = {reach, {}, static_cast<size_t>(min_cluster_size)};
  for (const auto& distances : reach) {
    search.levels.insert(search.levels.end(), distances.begin(), distances.end());
  }
  search.levels.push_back(0);  // below it no pair is connected
  std::sort(search.levels.begin(), search.levels.end(), std::greater<>());
  search.levels.erase(std::unique(search.levels.begin(), search.levels.end()), search.levels.end());
  Clusters clusters;
  clusters.labels.assign(reach.size(), kNoise);
  clusters.strengths.assign(reach.size(), 0);
  if (reach.size() < search.min_cluster_size) return clusters;
  Points all;
  for (size_t i = 0; i < reach.size(); ++i) all.push_back(static_cast<int>(i));
  const auto root = search.Explore(all, 0, 0);
  std::vector<const Node*> chosen = Best(*root, false).second;
  std::sort(chosen.begin(), chosen.end(), [](const Node* a, const Node* b) {
    return *std::min_element(a->points.begin(), a->points.end()) <
           *std::min_element(b->points.begin(), b->points.end());
  });
  for (const Node* node : chosen) {
    for (const int point : node->points) {
      clusters.labels[point] = clusters.count;
      // A point that is still in the cluster at its end leaves it there, whether or not a child has
      // it.
      const double left = node->left[point];
      clusters.strengths[point] =
          std::isinf(left) || left >= node->end ? 1 : static_cast<float>(left / node->end);
    }
    ++clusters.count;
  }
  return clusters;
}

// Normal groups of points around random centres.
struct Input {
  int count, num_channels, num_groups;
  double spread;
  bool integers;  // round the coordinates: many equal distances, and points that coincide
};

std::vector<float> PointsOf(const Input& input, uint64_t seed) {
  std::mt19937_64 random(seed);
  std::normal_distribution<double> normal;
  std::vector<double> centers(input.num_groups * input.num_channels);
  for (double& value : centers) value = 10 * normal(random);
  std::vector<float> points(static_cast<size_t>(input.count) * kFeatureSize);
  for (int point = 0; point < input.count; ++point) {
    const size_t group = random() % input.num_groups;
    for (int k = 0; k < input.num_channels; ++k) {
      const double value = centers[group * input.num_channels + k] + input.spread * normal(random);
      points[point * kFeatureSize + k] =
          static_cast<float>(input.integers ? std::round(value) : value);
    }
  }
  return points;
}

// Expects the same clusters as from NaiveHdbscan for 40 seeds and several options.
void ExpectNaive(const Input& input) {
  const std::unique_ptr<Backend> backend = MakeCpuBackend(1);
  int num_clusters = 0;
  for (uint64_t seed = 0; seed < 40; ++seed) {
    const std::vector<float> points = PointsOf(input, seed);
    for (const auto& [min_cluster_size, min_samples] :
         {std::pair(2, 1), std::pair(2, 3), std::pair(4, 4), std::pair(7, 2), std::pair(5, 8)}) {
      SCOPED_TRACE(::testing::Message() << "seed " << seed << ", min_cluster_size "
                                        << min_cluster_size << ", min_samples " << min_samples);
      const Clusters want = NaiveHdbscan(points, min_cluster_size, min_samples);
      const auto got = Hdbscan(*backend, points, {min_cluster_size, min_samples});
      ASSERT_OK(got);
      ASSERT_EQ(got->count, want.count);
      ASSERT_EQ(got->labels, want.labels);
      for (size_t i = 0; i < want.strengths.size(); ++i) {
        ASSERT_NEAR(got->strengths[i], want.strengths[i], 1e-5) << i;
      }
      num_clusters += got->count;
    }
  }
  EXPECT_GT(num_clusters, 100);
}

TEST(HdbscanRandom, MatchesTheDefinitionOnGroups) {
  ExpectNaive({.count = 36, .num_channels = 3, .num_groups = 4, .spread = 1, .integers = false});
  ExpectNaive({.count = 40, .num_channels = 32, .num_groups = 3, .spread = 4, .integers = false});
}

TEST(HdbscanRandom, MatchesTheDefinitionOnOneCloud) {
  ExpectNaive({.count = 40, .num_channels = 2, .num_groups = 1, .spread = 1, .integers = false});
}

TEST(HdbscanRandom, MatchesTheDefinitionOnEqualDistances) {
  ExpectNaive({.count = 40, .num_channels = 2, .num_groups = 3, .spread = 3, .integers = true});
  ExpectNaive({.count = 50, .num_channels = 1, .num_groups = 2, .spread = 15, .integers = true});
  ExpectNaive({.count = 30, .num_channels = 4, .num_groups = 5, .spread = 1, .integers = true});
}

TEST(HdbscanRandom, MatchesTheDefinitionOnFewPoints) {
  for (int count = 8; count < 16; ++count) {
    ExpectNaive(
        {.count = count, .num_channels = 2, .num_groups = 2, .spread = 3, .integers = true});
  }
}

}  // namespace
}  // namespace pepeseg
