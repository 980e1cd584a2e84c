#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "absl/functional/function_ref.h"
#include "absl/status/statusor.h"
#include "core/evaluate/evaluation_task.h"
#include "core/query/segmenter.h"

// What a protocol asks in the scored views of an entity, made from the prompt in its reference
// view, and the parts that protocols share in making it. Nothing here reads the truth of a scored
// view.

namespace pepeseg {

// Queries of one entity. A query without features finds nothing.
struct EntityQueries {
  std::vector<Query> by_scale;  // [scales] each with its scale; its threshold is not used
  Query automatic;              // scale and threshold chosen without any truth

  // Returns whether nothing was found under the prompt.
  bool missing() const;
};

// What queries are made for. The parts must outlive it.
struct QueryTask {
  const Segmenter& segmenter;
  const EvaluationTask& task;
  std::span<const double> scales;  // quantiles, [0, 1], ascending
  absl::FunctionRef<absl::Status()> check_cancelled;
  bool refine_borders = false;  // see EvaluationOptions
};

// Calls `make` for each entity and returns the queries, [entities of the task]. Entities with the
// same reference view follow each other, so that its feature map is rendered once. Calls
// `check_cancelled` before each entity and returns its error. An error of `make` gets the names of
// entity and view; NothingThereError becomes queries without features.
absl::StatusOr<std::vector<EntityQueries>> MakeQueries(
    const QueryTask& query_task,
    absl::FunctionRef<absl::StatusOr<EntityQueries>(const ScoredEntity&)> make);

// Returns the click of DeepestClick, in pixels of the reference view.
PointPrompt DeepestClickOf(const EvaluationTask& task, const ScoredEntity& entity);

// Maximum number of points, of each sign, that stand for scribbles.
inline constexpr size_t kScribblePoints = 32;

// Returns the prompt of an entity as Segment takes it. Scribbles become points, sampled evenly from
// the strokes; of them, and of a mean of points, only those are kept that are on something with a
// feature. Returns NothingThereError if no positive point is.
absl::StatusOr<Prompt> PromptOf(const Segmenter& segmenter, const EvaluationTask& task,
                                const ScoredEntity& entity);

// Returns the mask that the prompt gives: that of the entity in the reference view (DeepestClick,
// OwnMask), the prompt's own, or the positive strokes. Returns INVALID_ARGUMENT for other prompts.
absl::StatusOr<BinaryMask> PromptMaskOf(const EvaluationTask& task, const ScoredEntity& entity);

// Returns at most `max_count` pixels of a mask, y * width + x, evenly spread over its pixels in
// reading order.
std::vector<int32_t> SampleMask(std::span<const uint8_t> mask, size_t max_count);

// Returns the features of those pixels that can be in a mask, [found, 32]: the length of the
// blended feature is at least kMinPixelNorm. If `found` is not null, it gets their indices in
// `pixels`.
absl::StatusOr<std::vector<float>> SolidFeatures(const Segmenter& segmenter, const ModelView& view,
                                                 std::span<const int32_t> pixels,
                                                 std::vector<size_t>* found = nullptr);

}  // namespace pepeseg
