#include "tests/bench/mask_scores.h"

#include <algorithm>
#include <cstdint>

namespace pepeseg {
namespace {

constexpr int64_t kMinPixels =
    100;  // minimum size of an entity in a view, as in the one-click protocol

// Returns, by entity, the best IoU and the number of pixels.
std::map<uint16_t, std::pair<double, int64_t>> BestIous(const MaskSet& masks,
                                                        const std::vector<uint16_t>& labels) {
  std::map<uint16_t, std::pair<double, int64_t>> best;
  for (const uint16_t label : labels) {
    if (label != 0) ++best[label].second;
  }
  for (int k = 0; k < masks.num_masks; ++k) {
    std::map<uint16_t, int64_t> inside;
    const BinaryMask mask = masks.Extract(k);
    for (size_t i = 0; i < labels.size(); ++i) {
      if (mask.pixels[i] != 0) ++inside[labels[i]];
    }
    for (const auto& [label, both] : inside) {
      if (label == 0) continue;
      auto& [iou, num_pixels] = best[label];
      const auto either = static_cast<double>(num_pixels + masks.mask_area[k] - both);
      iou = std::max(iou, static_cast<double>(both) / either);
    }
  }
  return best;
}

}  // namespace

void MaskScores::Add(const MaskSet& masks, const std::vector<TruthLevel>& truth, size_t index) {
  ++num_views_;
  num_masks_ += masks.num_masks;
  for (const TruthLevel& level : truth) {
    if (level.labels[index].empty()) continue;
    for (const auto& [label, best] : BestIous(masks, level.labels[index])) {
      if (best.second < kMinPixels) continue;
      auto& [sum, count] = of_level_[level.name];
      sum += best.first;
      ++count;
    }
  }
}

double MaskScores::masks_per_view() const { return num_masks_ / std::max(1, num_views_); }

}  // namespace pepeseg
