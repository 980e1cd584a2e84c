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

// Returns the prompt of an entity as Segment takes it.
Prompt PromptOf(const EvaluationTask& task, const ScoredEntity& entity);

// Returns the mask that the prompt gives: that of the entity in the reference view (DeepestClick,
// OwnMask), the prompt's own, or the positive strokes. Returns INVALID_ARGUMENT for other prompts.
absl::StatusOr<BinaryMask> PromptMaskOf(const EvaluationTask& task, const ScoredEntity& entity);

}  // namespace pepeseg
