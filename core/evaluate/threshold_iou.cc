#include "core/evaluate/threshold_iou.h"

#include <array>
#include <cassert>

namespace pepeseg {

std::vector<double> IouByThreshold(std::span<const float> similarity, const LabeledView& view,
                                   uint16_t entity, std::span<const double> thresholds) {
  assert(similarity.size() == view.labels.size());
  const std::vector<float> edges(thresholds.begin(), thresholds.end());
  // [i]: pixels over the first i thresholds and no more, outside and inside the entity.
  std::vector<std::array<int64_t, 2>> over(edges.size() + 1);
  for (size_t pixel = 0; pixel < similarity.size(); ++pixel) {
    if (!view.Counts(pixel)) continue;
    size_t bin = 0;
    while (bin < edges.size() && similarity[pixel] > edges[bin]) ++bin;
    ++over[bin][view.labels[pixel] == entity ? 1 : 0];
  }
  int64_t num_inside = 0;
  for (const auto& bin : over) num_inside += bin[1];
  std::vector<double> ious(edges.size());
  int64_t both = 0, outside = 0;
  for (size_t i = edges.size(); i > 0; --i) {
    outside += over[i][0];
    both += over[i][1];
    const int64_t either = num_inside + outside;
    ious[i - 1] = either == 0 ? 1.0 : static_cast<double>(both) / static_cast<double>(either);
  }
  return ious;
}

}  // namespace pepeseg
