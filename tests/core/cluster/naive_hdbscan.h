#pragma once

#include <vector>

#include "core/cluster/condensed_tree.h"

namespace pepeseg {

// HDBSCAN from its definition: from above, at each level of the density the components of the
// graph of all pairs. points [n, 32], all finite.
Clusters NaiveHdbscan(const std::vector<float>& points, int min_cluster_size, int min_samples);

}  // namespace pepeseg
