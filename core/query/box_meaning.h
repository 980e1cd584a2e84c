#pragma once

#include "absl/status/statusor.h"
#include "core/query/image_segmenter.h"
#include "core/query/prompt.h"
#include "core/query/prompt_meaning.h"
#include "core/query/segmenter.h"

namespace pepeseg {

// Returns what a box in a view means (METHOD.md section 4, "Box"): of the image segmenter's masks
// the one with the largest product of its estimated IoU and the IoU of the box and its own bounding
// box. Where it sees nothing there, the model answers (FitBox). Errors are those of FitBox, of the
// segmenter and of `check`.
absl::StatusOr<PromptMeaning> FindInBox(const Segmenter& model, ImageSegmenter& images,
                                        const ModelView& view, const BoxPrompt& box,
                                        const WantedCheck& check);

}  // namespace pepeseg
