#pragma once

#include <utility>
#include <vector>

#include "core/query/mask_grid.h"

namespace pepeseg::testing {

inline std::vector<float> ScaleThresholds() { return {0.5f, 0.6f, 0.7f, 0.8f, 0.9f}; }

// Counts the masks of similarity maps at ScaleThresholds() pixel by pixel, as a reference for the
// product's own counting. Add() one scale after the other: 0, 1, 2, ...
class Scales {
 public:
  void Add(const std::vector<float>& positive, const std::vector<float>& negative) {
    std::vector<int>& levels = levels_.emplace_back();
    levels.reserve(positive.size());
    for (size_t p = 0; p < positive.size(); ++p) {
      int level = 0;
      for (const float threshold : ScaleThresholds()) level += positive[p] > threshold ? 1 : 0;
      levels.push_back(positive[p] > negative[p] ? level : 0);
    }
  }
  MaskGrid Grid() const {
    const auto num_thresholds = static_cast<int>(ScaleThresholds().size());
    const size_t side = num_thresholds + 1, num = levels_.size();
    LevelCounts counts = {static_cast<int>(num), num_thresholds, {}};
    counts.pixels.resize(num * num * side * side);
    for (size_t a = 0; a < num; ++a) {
      for (size_t b = a; b < num; ++b) {
        for (size_t p = 0; p < levels_[a].size(); ++p) {
          if (levels_[a][p] + levels_[b][p] == 0) continue;
          ++counts.pixels[((a * num + b) * side + levels_[a][p]) * side + levels_[b][p]];
        }
      }
    }
    GranularityGrid grid = {{}, ScaleThresholds()};
    for (size_t k = 0; k < num; ++k) grid.scales.push_back(static_cast<double>(k));
    return {std::move(counts), std::move(grid)};
  }

 private:
  std::vector<std::vector<int>> levels_;
};

}  // namespace pepeseg::testing
