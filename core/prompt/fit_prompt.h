#pragma once

#include "absl/status/statusor.h"
#include "core/query/prompt.h"
#include "core/query/segmenter.h"

namespace pepeseg {

// The question whose mask in the view is most like `mask`, by IoU: features under it as one to four
// clusters, a scale and a threshold (METHOD.md section 4, "Mask"). INVALID_ARGUMENT: a mask that is
// empty or not of the view's size, nothing with a feature is rendered under it.
absl::StatusOr<Query> FitMask(const Segmenter& segmenter, const ModelView& view,
                              const BinaryMask& mask, const Granularity& granularity);

// The question whose mask fills the box best: the IoU of the box and the mask's own, times the
// share of the mask that is inside. One of the features in the middle of the box, a scale and a
// threshold. INVALID_ARGUMENT: a box that is not finite, is empty or lies outside of the view,
// nothing with a feature is rendered there.
absl::StatusOr<Query> FitBox(const Segmenter& segmenter, const ModelView& view,
                             const BoxPrompt& box, const Granularity& granularity);

}  // namespace pepeseg
