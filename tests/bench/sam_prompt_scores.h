#pragma once

#include "absl/status/status.h"
#include "core/evaluate/evaluation_task.h"
#include "core/query/image_segmenter.h"
#include "core/query/segmenter.h"

// Prompts whose answers SAM may improve, by the model alone and by both. images: null: by the
// model.
namespace pepeseg {

// Prints the mean IoU of boxes around the entities of a task in their reference views, on that view
// and on the scored ones. by_entity: also a line for each entity.
absl::Status PrintBoxes(const Segmenter& segmenter, ImageSegmenter* images,
                        const EvaluationTask& task, bool by_entity);

// Prints the mean IoU of selections in 3D, of one click on the deepest pixel of each entity,
// rendered back to the scored views.
absl::Status PrintSelections(const Segmenter& segmenter, ImageSegmenter* images,
                             const EvaluationTask& task);

}  // namespace pepeseg
