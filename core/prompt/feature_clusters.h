#pragma once

#include <span>
#include <vector>

namespace pepeseg {

// The means of `count` clusters of features by direction: farthest first from the mean, then five
// rounds of Lloyd's algorithm on unit vectors. Clusters of under `min_share` of the features are
// dropped. features: [n, 32], no row 0. Returns [clusters, 32] of length 1, the largest first.
std::vector<float> ClusterDirections(std::span<const float> features, int count, double min_share);

}  // namespace pepeseg
