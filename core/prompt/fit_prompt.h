#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "absl/status/statusor.h"
#include "core/query/prompt.h"
#include "core/query/segmenter.h"

namespace pepeseg {

// Returns the query whose mask in the view has the best IoU with `mask`: the features under it as
// one to four clusters, a scale and a threshold (METHOD.md section 4, "Mask"). Returns
// INVALID_ARGUMENT if the mask is empty or does not have the view's size, and NothingThereError if
// no feature is rendered under it.
absl::StatusOr<Query> FitMask(const Segmenter& segmenter, const ModelView& view,
                              const BinaryMask& mask, const Granularity& granularity);

// Returns the query whose mask fills the box best, scored mainly by the IoU of the box and the
// mask's bounding box, times the share of the mask inside the box. The query has one feature from
// the middle of the box, or several where only their masks together fill it, a scale and a
// threshold. Returns INVALID_ARGUMENT if the box is not finite, is empty or lies outside the view,
// and NothingThereError if no feature is rendered there.
absl::StatusOr<Query> FitBox(const Segmenter& segmenter, const ModelView& view,
                             const BoxPrompt& box, const Granularity& granularity);

// Returns, for each pixel, how many of the thresholds its similarity exceeds. At most 255
// thresholds.
std::vector<uint8_t> LevelsOf(std::span<const float> similarity, std::span<const float> thresholds);

}  // namespace pepeseg
