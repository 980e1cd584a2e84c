#include "core/evaluate/entity_queries.h"

#include <algorithm>
#include <numeric>
#include <utility>

#include "core/base/status_macros.h"
#include "core/query/mask_geometry.h"
#include "core/query/prompt.h"
#include "core/render/renderer.h"

namespace pepeseg {

bool EntityQueries::missing() const {
  return automatic.features.empty() &&
         std::all_of(by_scale.begin(), by_scale.end(),
                     [](const Query& query) { return query.features.empty(); });
}

absl::StatusOr<std::vector<EntityQueries>> MakeQueries(
    const QueryTask& query_task,
    absl::FunctionRef<absl::StatusOr<EntityQueries>(const ScoredEntity&)> make) {
  const EvaluationTask& task = query_task.task;
  std::vector<size_t> order(task.entities.size());
  std::iota(order.begin(), order.end(), size_t{0});
  std::stable_sort(order.begin(), order.end(), [&](size_t a, size_t b) {
    return task.entities[a].reference < task.entities[b].reference;
  });
  std::vector<EntityQueries> queries(task.entities.size());
  for (const size_t i : order) {
    RETURN_IF_ERROR(query_task.check_cancelled());
    absl::StatusOr<EntityQueries> made = make(task.entities[i]);
    if (made.ok()) {
      queries[i] = *std::move(made);
    } else if (IsNothingThere(made.status())) {
      queries[i].by_scale.resize(query_task.scales.size());
    } else {
      return InReference(task, task.entities[i], made.status());
    }
  }
  return queries;
}

PointPrompt DeepestClickOf(const EvaluationTask& task, const ScoredEntity& entity) {
  const TruthView& truth = task.views[entity.reference];
  const Camera& camera = truth.view.camera;
  const PixelIndex pixel =
      DeepestPixel(truth.CountedMaskOf(entity.name), camera.width, camera.height);
  return {pixel.x + 0.5, pixel.y + 0.5, true};
}

Prompt PromptOf(const EvaluationTask& task, const ScoredEntity& entity) {
  const TruthView& truth = task.views[entity.reference];
  return {truth.view, std::visit(Overloaded{[&](const DeepestClick&) -> Shape {
                                              return PointsPrompt{DeepestClickOf(task, entity)};
                                            },
                                            [&](const OwnMask&) -> Shape {
                                              return BinaryMask{truth.CountedMaskOf(entity.name)};
                                            },
                                            [](const Shape& shape) { return shape; }},
                                 entity.prompt)};
}

absl::StatusOr<BinaryMask> PromptMaskOf(const EvaluationTask& task, const ScoredEntity& entity) {
  const auto* shape = std::get_if<Shape>(&entity.prompt);
  if (shape == nullptr) {
    return BinaryMask{task.views[entity.reference].CountedMaskOf(entity.name)};
  }
  if (const BinaryMask* mask = MaskOf(*shape)) return *mask;
  return absl::InvalidArgumentError(
      "the protocol needs a mask or scribbles; the prompt is points or a box");
}

}  // namespace pepeseg
