#pragma once

#include <cstdint>
#include <random>
#include <vector>

#include "core/reconstruct/reconstruct.h"

namespace pepeseg {

// What density control looks at, on the host: planes kMeanPlane to kOpacityPlane and statistics.
struct DensityInput {
  int64_t count = 0;
  std::vector<float> planes;         // [kOpacityPlane + 1, count]
  std::vector<float> grad_sum;       // [count], see DensityStats
  std::vector<int32_t> num_visible;  // [count]
};

struct DensityRules {
  float gradient = 0;     // mean |d loss / d mean2d| from which a Gaussian is densified
  float clone_size = 0;   // scene units: one whose largest deviation is larger is split
  float min_opacity = 0;  // fainter: pruned
  int64_t max_count = 0;  // where room is short, the largest gradients come first
};

// The rows after density control (Kerbl et al. 2023, section 5), in Morton order of their means:
// neighbours in space become neighbours in memory.
struct DensityPlan {
  std::vector<int32_t> source;  // [new count] the row that a new row's parameters come from
  std::vector<uint8_t> is_new;  // [new count] moments and step count start at 0
  std::vector<float> mean_and_log_scale;  // [6, new count], for planes kMeanPlane to 5
  int64_t num_cloned = 0, num_split = 0, num_pruned = 0;
};

// A small Gaussian is cloned in place; a large one is replaced by two that are drawn from it, 1.6
// times smaller.
DensityPlan PlanDensity(const DensityInput& input, const DensityRules& rules,
                        std::mt19937_64& random);

}  // namespace pepeseg
