#include "tests/core/cluster/naive_hdbscan.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <memory>

#include "kernels/ops/render.h"

namespace pepeseg {
namespace {

using Matrix = std::vector<std::vector<double>>;
using Points = std::vector<int>;

// Distances between points of whole numbers are exact.
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
  for (std::vector<double> row : distance) {
    std::sort(row.begin(), row.end());
    core.push_back(row[min_samples - 1]);
  }
  for (size_t a = 0; a < count; ++a) {
    for (size_t b = 0; b < count; ++b) {
      distance[a][b] = std::max({distance[a][b], core[a], core[b]});
    }
  }
  return distance;
}

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

struct Node {
  Points points;
  double stability = 0, end = 0;
  std::vector<double> left;  // by point of the input: lambda at which it leaves, or 0
  std::vector<std::unique_ptr<Node>> children;
};

struct Search {
  const Matrix& reach;
  std::vector<double> levels;  // all distances, descending
  size_t min_cluster_size;

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

// The best choice at or below a node, and its stability.
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

}  // namespace

Clusters NaiveHdbscan(const std::vector<float>& points, int min_cluster_size, int min_samples) {
  const Matrix reach = MutualReachability(points, min_samples);
  Search search = {reach, {}, static_cast<size_t>(min_cluster_size)};
  for (const auto& row : reach) search.levels.insert(search.levels.end(), row.begin(), row.end());
  search.levels.push_back(0);  // below it there is nothing
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
      // Points that go on in children are in them to the cluster's end and beyond.
      const double left = node->left[point];
      clusters.strengths[point] =
          std::isinf(left) || left >= node->end ? 1 : static_cast<float>(left / node->end);
    }
    ++clusters.count;
  }
  return clusters;
}

}  // namespace pepeseg
