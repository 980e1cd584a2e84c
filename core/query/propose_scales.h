#pragma once

#include <span>
#include <vector>

#include "absl/status/statusor.h"
#include "core/query/segmenter.h"

namespace pepeseg {

// One thing that a prompt may mean.
struct ScaleProposal {
  SegmentResult result;  // in the prompt's view, with the scale and threshold that show it
  double stability = 0;  // in [0, 1]: how little the mask changes beside them
  double support = 0;    // in (0, 1]: the share of all scales and thresholds that show this mask
};

inline constexpr int kDefaultProposals = 5;

// The granularities at which there is something stable under a prompt: a part, an object, a group
// (method.md section 4). Those with the most support first, at most `max_count`; none where no mask
// of some pixels appears at any scale. No view is rendered that has been. INVALID_ARGUMENT as
// Segmenter::PointFeatures; max_count under 1.
absl::StatusOr<std::vector<ScaleProposal>> ProposeScales(const Segmenter& segmenter,
                                                         const ModelView& view,
                                                         std::span<const PointPrompt> points,
                                                         int max_count = kDefaultProposals);

}  // namespace pepeseg
