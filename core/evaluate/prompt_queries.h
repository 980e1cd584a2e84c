#pragma once

#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "core/evaluate/entity_queries.h"
#include "core/evaluate/evaluation_task.h"
#include "core/query/segmenter.h"

// Queries of the protocols that ask for the features of the prompt itself.

namespace pepeseg {

// Makes the queries of protocol "prompt", which is "one click" where no prompt is given: the
// features that Segment takes from the prompt. Points and scribbles have one feature a point; a box
// and a mask have those that fit best at each scale; a mean of points is GatedMean at each scale.
// `automatic` has the scale and the threshold that ResolvePrompt chooses. For errors see
// MakeQueries.
absl::StatusOr<std::vector<EntityQueries>> PromptQueries(const QueryTask& query_task);

struct PromptableOptions {
  double min_cosine = 0.9;  // threshold, [-1, 1]
  int max_points = 256;     // pixels sampled from a mask or from strokes, 1 to 16384
};
// Returns INVALID_ARGUMENT, which names the option, its value and its limits.
absl::Status Validate(const PromptableOptions& options);

// Makes the queries of protocol "promptable" (METHOD.md section 5): GatedMean of the features of
// pixels that are sampled evenly from the mask of the prompt (PromptMaskOf), or of the positive
// points. `automatic` has the scale that ResolvePrompt chooses for the prompt at `min_cosine`; a
// DeepestClick stands for the entity's mask. Returns INVALID_ARGUMENT for a box.
absl::StatusOr<std::vector<EntityQueries>> PromptableQueries(const QueryTask& query_task,
                                                             const PromptableOptions& options);

// Returns the scale that ResolvePrompt chooses for the prompt where only the threshold is given.
// A DeepestClick stands for the entity's mask.
absl::StatusOr<double> AutomaticScale(const Segmenter& segmenter, const EvaluationTask& task,
                                      const ScoredEntity& entity, double threshold);

}  // namespace pepeseg
