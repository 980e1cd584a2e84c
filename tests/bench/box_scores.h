#pragma once

#include "absl/status/status.h"
#include "core/evaluate/evaluation_task.h"
#include "core/query/image_segmenter.h"
#include "core/query/segmenter.h"

namespace pepeseg {

// Prints the mean IoU of box prompts, the boxes around the entities of a task in their reference
// views, on that view and on the scored ones: by the model alone and, with an image segmenter (else
// null), by both. by_entity: also a line for each entity.
absl::Status PrintBoxes(const Segmenter& segmenter, ImageSegmenter* images,
                        const EvaluationTask& task, bool by_entity);

}  // namespace pepeseg
