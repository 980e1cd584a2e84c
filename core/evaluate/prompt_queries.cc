#include "core/evaluate/prompt_queries.h"

#include <utility>

#include "absl/strings/str_cat.h"
#include "core/base/status_macros.h"
#include "core/query/prompt.h"
#include "core/query/resolve_prompt.h"

namespace pepeseg {
namespace {

constexpr int kMostPoints = 16'384;

std::vector<int32_t> PixelsOf(std::span<const PointPrompt> points, int width) {
  std::vector<int32_t> pixels;
  for (const PointPrompt& point : points) {
    if (!point.positive) continue;
    pixels.push_back(static_cast<int32_t>(point.y) * width + static_cast<int32_t>(point.x));
  }
  return pixels;
}

// Returns the query whose only feature is the mean direction of `features` at its scale.
Query MeanQuery(const Segmenter& segmenter, std::span<const float> features, double scale,
                double threshold) {
  return {GatedMean(features, segmenter.model().field.gate, static_cast<float>(scale)),
          {1},
          scale,
          threshold};
}

absl::StatusOr<EntityQueries> QueriesOfPrompt(const QueryTask& query_task,
                                              const ScoredEntity& entity) {
  const Segmenter& segmenter = query_task.segmenter;
  ASSIGN_OR_RETURN(const Prompt prompt, PromptOf(segmenter, query_task.task, entity));
  const auto* points = std::get_if<std::vector<PointPrompt>>(&prompt.what);
  const bool is_mean = std::holds_alternative<PointMean>(entity.prompt);
  std::vector<float> of_mean;
  if (is_mean) {
    ASSIGN_OR_RETURN(of_mean, SolidFeatures(segmenter, prompt.view,
                                            PixelsOf(*points, prompt.view.camera.width)));
  }
  const auto resolve = [&](const Granularity& granularity) -> absl::StatusOr<Query> {
    ASSIGN_OR_RETURN(Query query, ResolvePrompt(segmenter, prompt, granularity));
    if (is_mean) query = MeanQuery(segmenter, of_mean, query.scale, query.threshold);
    return query;
  };
  EntityQueries queries;
  for (const double scale : query_task.scales) {
    Granularity granularity = {.scale = scale};
    // The features of points do not depend on the threshold, those of a box or a mask do.
    if (points != nullptr) granularity.threshold = Query().threshold;
    ASSIGN_OR_RETURN(queries.by_scale.emplace_back(), resolve(granularity));
  }
  ASSIGN_OR_RETURN(queries.automatic, resolve({}));
  return queries;
}

// Returns the features that protocol "promptable" takes the mean of.
absl::StatusOr<std::vector<float>> FeaturesToMean(const Segmenter& segmenter,
                                                  const EvaluationTask& task,
                                                  const ScoredEntity& entity, int max_points) {
  const ModelView& view = task.views[entity.reference].view;
  std::vector<int32_t> pixels;
  if (const auto* points = std::get_if<std::vector<PointPrompt>>(&entity.prompt)) {
    pixels = PixelsOf(*points, view.camera.width);
  } else if (const auto* mean = std::get_if<PointMean>(&entity.prompt)) {
    pixels = PixelsOf(mean->points, view.camera.width);
  } else {
    ASSIGN_OR_RETURN(const BinaryMask mask, PromptMaskOf(task, entity));
    pixels = SampleMask(mask.pixels, static_cast<size_t>(max_points));
  }
  ASSIGN_OR_RETURN(std::vector<float> features, SolidFeatures(segmenter, view, pixels));
  if (!features.empty()) return features;
  return NothingThereError("nothing with a feature is rendered under the prompt");
}

}  // namespace

absl::Status Validate(const PromptableOptions& options) {
  if (!(options.min_cosine >= -1 && options.min_cosine <= 1)) {
    return absl::InvalidArgumentError(
        absl::StrCat("promptable.min_cosine is ", options.min_cosine, ", must be in [-1, 1]"));
  }
  if (options.max_points >= 1 && options.max_points <= kMostPoints) return absl::OkStatus();
  return absl::InvalidArgumentError(absl::StrCat("promptable.max_points is ", options.max_points,
                                                 ", must be in [1, ", kMostPoints, "]"));
}

absl::StatusOr<std::vector<EntityQueries>> PromptQueries(const QueryTask& query_task) {
  return MakeQueries(
      query_task, [&](const ScoredEntity& entity) { return QueriesOfPrompt(query_task, entity); });
}

absl::StatusOr<double> AutomaticScale(const Segmenter& segmenter, const EvaluationTask& task,
                                      const ScoredEntity& entity, double threshold) {
  Prompt prompt = {task.views[entity.reference].view, {}};
  if (std::holds_alternative<DeepestClick>(entity.prompt)) {
    ASSIGN_OR_RETURN(prompt.what, PromptMaskOf(task, entity));
  } else {
    ASSIGN_OR_RETURN(prompt, PromptOf(segmenter, task, entity));
  }
  ASSIGN_OR_RETURN(const Query query, ResolvePrompt(segmenter, prompt, {.threshold = threshold}));
  return query.scale;
}

absl::StatusOr<std::vector<EntityQueries>> PromptableQueries(const QueryTask& query_task,
                                                             const PromptableOptions& options) {
  const double threshold = options.min_cosine;
  return MakeQueries(query_task, [&](const ScoredEntity& entity) -> absl::StatusOr<EntityQueries> {
    ASSIGN_OR_RETURN(
        const std::vector<float> features,
        FeaturesToMean(query_task.segmenter, query_task.task, entity, options.max_points));
    EntityQueries queries;
    for (const double scale : query_task.scales) {
      queries.by_scale.push_back(MeanQuery(query_task.segmenter, features, scale, threshold));
    }
    ASSIGN_OR_RETURN(const double scale,
                     AutomaticScale(query_task.segmenter, query_task.task, entity, threshold));
    queries.automatic = MeanQuery(query_task.segmenter, features, scale, threshold);
    return queries;
  });
}

}  // namespace pepeseg
