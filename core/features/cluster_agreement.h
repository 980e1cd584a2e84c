#pragma once

#include <cstdint>
#include <span>

#include "core/cluster/condensed_tree.h"
#include "core/scene/mask_set.h"

namespace pepeseg {

// The clusters of a view's pixels without those that its masks tell apart at a scale: of a
// cluster's pixels that have a label there (see ScaleLabels), no mask holds kMinAgreement. What
// features confuse would else be pulled together for good by the centroid loss. Their pixels become
// noise, the others keep their order. pixels: of the cluster labels. mask_scales: [num_masks].
inline constexpr double kMinAgreement = 0.7;
Clusters KeepAgreeing(const Clusters& clusters, const MaskSet& masks,
                      std::span<const int32_t> pixels, std::span<const float> mask_scales,
                      float scale);

}  // namespace pepeseg
