#pragma once

#include <map>
#include <string>
#include <utility>
#include <vector>

#include "core/scene/mask_set.h"
#include "tests/bench/capture_pack.h"

namespace pepeseg {

// How well masks match the entities of ground truth: for each entity of at least 100 pixels in a
// view, the best IoU with one mask.
class MaskScores {
 public:
  // Adds the masks of view `index`. Levels that do not label the view are left out.
  void Add(const MaskSet& masks, const std::vector<TruthLevel>& truth, size_t index);

  double masks_per_view() const;
  // By name of the level: the sum of the best IoUs, and their number.
  const std::map<std::string, std::pair<double, int>>& of_level() const { return of_level_; }

 private:
  std::map<std::string, std::pair<double, int>> of_level_;
  double num_masks_ = 0;
  int num_views_ = 0;
};

}  // namespace pepeseg
