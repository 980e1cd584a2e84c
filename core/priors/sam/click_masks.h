#pragma once

#include <array>
#include <span>
#include <vector>

#include "absl/status/statusor.h"
#include "core/priors/sam/prompted_segmenter.h"
#include "core/scene/soft_mask.h"

namespace pepeseg {

// Returns the masks that clicks in the segmenter's image may mean; the first click is positive.
// Without a mask before the last click (null), one click has three answers, smallest first in
// general: the part, the object and the whole that SAM sees there; several clicks have one. With
// one, the first answer is that mask, changed as the last click asks (Kirillov et al. 2023,
// "Segment Anything", on interactive use), and the other three are of a part, an object and a
// whole. A mask without logits is one of other origin. The size is that of the segmenter's image.
// Returns the errors of Segment and SegmentByMask.
absl::StatusOr<std::vector<SoftMask>> SegmentClicks(PromptedSegmenter& segmenter,
                                                    std::span<const PromptPoint> clicks,
                                                    const SoftMask* before, int width, int height);

// Returns the four masks that a box may mean, given by its first and its last corner: the one that
// SAM takes for prompts that leave no doubt, and three of different size. Size and errors are those
// of SegmentClicks.
absl::StatusOr<std::vector<SoftMask>> SegmentBox(PromptedSegmenter& segmenter,
                                                 const std::array<PromptPoint, 2>& box, int width,
                                                 int height);

}  // namespace pepeseg
