#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "core/evaluate/labeled_view.h"

namespace pepeseg {

// Iou of the pixels over each threshold with those of an entity, from one pass over the similarity
// [height, width] of the view. `thresholds`: cosines, ascending. Ignored pixels do not count.
std::vector<double> IouByThreshold(std::span<const float> similarity, const LabeledView& view,
                                   uint16_t entity, std::span<const double> thresholds);

}  // namespace pepeseg
