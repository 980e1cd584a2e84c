#pragma once

#include <array>
#include <vector>

#include "core/scene/model.h"

namespace pepeseg::testing {

// Clusters of Gaussians, without views: parts 0 and 1 make group 0, parts 2 and 3 group 1. At small
// scales the parts' features are far apart, at large ones those of a group are one. The last
// Gaussian is like nothing else.
struct NestedParts {
  static constexpr std::array<int, 4> kSizes = {40, 30, 20, 12};
  Model model;
  std::vector<int> part;  // [num_gaussians], of the last one -1
};
NestedParts MakeNestedParts();

}  // namespace pepeseg::testing
