#include "core/evaluate/entity_queries.h"

#include <algorithm>
#include <numeric>
#include <utility>

#include "core/base/status_macros.h"
#include "core/query/mask_geometry.h"
#include "core/query/prompt.h"
#include "core/render/renderer.h"

namespace pepeseg {
namespace {

// Returns the points that are on something with a feature.
absl::StatusOr<std::vector<PointPrompt>> PointsOnSomething(const Segmenter& segmenter,
                                                           const ModelView& view,
                                                           const std::vector<PointPrompt>& points) {
  std::vector<int32_t> pixels;
  pixels.reserve(points.size());
  for (const PointPrompt& point : points) {
    pixels.push_back(static_cast<int32_t>(point.y) * view.camera.width +
                     static_cast<int32_t>(point.x));
  }
  std::vector<size_t> found;
  RETURN_IF_ERROR(SolidFeatures(segmenter, view, pixels, &found).status());
  std::vector<PointPrompt> kept;
  kept.reserve(found.size());
  for (const size_t i : found) kept.push_back(points[i]);
  if (std::any_of(kept.begin(), kept.end(), [](const PointPrompt& p) { return p.positive; })) {
    return kept;
  }
  return NothingThereError("nothing with a feature is rendered under the positive points");
}

void AddStroke(const BinaryMask& stroke, int width, bool positive,
               std::vector<PointPrompt>& points) {
  for (const int32_t pixel : SampleMask(stroke.pixels, kScribblePoints)) {
    const int32_t x = pixel % width, y = pixel / width;
    points.push_back({x + 0.5, y + 0.5, positive});
  }
}

}  // namespace

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

absl::StatusOr<Prompt> PromptOf(const Segmenter& segmenter, const EvaluationTask& task,
                                const ScoredEntity& entity) {
  const TruthView& truth = task.views[entity.reference];
  Prompt prompt = {truth.view, {}};
  if (const auto* points = std::get_if<std::vector<PointPrompt>>(&entity.prompt)) {
    prompt.what = *points;
  } else if (const auto* box = std::get_if<BoxPrompt>(&entity.prompt)) {
    prompt.what = *box;
  } else if (const auto* mask = std::get_if<BinaryMask>(&entity.prompt)) {
    prompt.what = *mask;
  } else if (std::holds_alternative<OwnMask>(entity.prompt)) {
    prompt.what = BinaryMask{truth.CountedMaskOf(entity.name)};
  } else if (std::holds_alternative<DeepestClick>(entity.prompt)) {
    prompt.what = std::vector{DeepestClickOf(task, entity)};
  } else {
    std::vector<PointPrompt> points;
    if (const auto* mean = std::get_if<PointMean>(&entity.prompt)) points = mean->points;
    if (const auto* scribbles = std::get_if<Scribbles>(&entity.prompt)) {
      AddStroke(scribbles->positive, truth.view.camera.width, true, points);
      AddStroke(scribbles->negative, truth.view.camera.width, false, points);
    }
    ASSIGN_OR_RETURN(prompt.what, PointsOnSomething(segmenter, truth.view, points));
  }
  return prompt;
}

absl::StatusOr<BinaryMask> PromptMaskOf(const EvaluationTask& task, const ScoredEntity& entity) {
  if (std::holds_alternative<DeepestClick>(entity.prompt) ||
      std::holds_alternative<OwnMask>(entity.prompt)) {
    return BinaryMask{task.views[entity.reference].CountedMaskOf(entity.name)};
  }
  if (const auto* mask = std::get_if<BinaryMask>(&entity.prompt)) return *mask;
  if (const auto* scribbles = std::get_if<Scribbles>(&entity.prompt)) return scribbles->positive;
  return absl::InvalidArgumentError(
      "the protocol needs a mask or scribbles; the prompt is points or a box");
}

std::vector<int32_t> SampleMask(std::span<const uint8_t> mask, size_t max_count) {
  std::vector<int32_t> pixels;
  for (size_t i = 0; i < mask.size(); ++i) {
    if (mask[i] != 0) pixels.push_back(static_cast<int32_t>(i));
  }
  if (pixels.size() <= max_count) return pixels;
  std::vector<int32_t> kept;
  kept.reserve(max_count);
  for (size_t k = 0; k < max_count; ++k) {
    kept.push_back(pixels[(2 * k + 1) * pixels.size() / (2 * max_count)]);
  }
  return kept;
}

absl::StatusOr<std::vector<float>> SolidFeatures(const Segmenter& segmenter, const ModelView& view,
                                                 std::span<const int32_t> pixels,
                                                 std::vector<size_t>* found) {
  if (found != nullptr) found->clear();
  if (pixels.empty()) return std::vector<float>();
  ASSIGN_OR_RETURN(const std::vector<float> features, segmenter.PixelFeatures(view, pixels));
  std::vector<float> kept;
  for (size_t i = 0; i < pixels.size(); ++i) {
    const auto first = features.begin() + static_cast<int64_t>(i) * kFeatureSize;
    if (FeatureNorm(&*first) < double{kMinPixelNorm}) continue;
    kept.insert(kept.end(), first, first + kFeatureSize);
    if (found != nullptr) found->push_back(i);
  }
  return kept;
}

}  // namespace pepeseg
