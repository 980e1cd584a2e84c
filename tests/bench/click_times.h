#pragma once

#include "absl/status/status.h"
#include "core/evaluate/evaluate.h"
#include "core/evaluate/evaluation_task.h"
#include "core/query/image_segmenter.h"
#include "core/query/segmenter.h"

namespace pepeseg {

// Prints the time to answer the first, second and third click of the protocol "clicks" in the
// clicked view, median and 90 % quantile over the entities, ms: all clicks at once, and the last one
// with the answer before it. `clicks` has those of the entities of `task`. images: may be null. The
// feature maps, and what the image segmenter needs of a view, are there before.
absl::Status PrintClickTimes(const Segmenter& segmenter, ImageSegmenter* images,
                             const EvaluationTask& task, const EvaluationResult& clicks);

}  // namespace pepeseg
