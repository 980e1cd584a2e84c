#pragma once

#include <array>
#include <vector>

#include "core/scene/model.h"

namespace pepeseg::testing {

// A model without views: parts 0 and 1 form group 0, parts 2 and 3 form group 1. At small scales
// the features of the parts are far apart, at large scales those of a group are the same. The last
// Gaussian is similar to no other.
struct NestedParts {
  static constexpr std::array<int, 4> kSizes = {40, 30, 20, 12};
  Model model;
  std::vector<int> part;  // [num_gaussians]; -1 for the last one
};
NestedParts MakeNestedParts();

}  // namespace pepeseg::testing
