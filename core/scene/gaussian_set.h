#pragma once

#include <algorithm>
#include <cstdint>
#include <vector>

namespace pepeseg {

// Some of a model's Gaussians.
struct GaussianSet {
  std::vector<uint8_t> member;  // [num_gaussians], 0 or 1

  int64_t count() const { return std::count(member.begin(), member.end(), uint8_t{1}); }
};

}  // namespace pepeseg
