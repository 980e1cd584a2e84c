#include "core/evaluate/prompt_queries.h"

#include <utility>

#include "absl/strings/str_cat.h"
#include "core/base/status_macros.h"
#include "core/query/prompt.h"
#include "core/query/resolve_prompt.h"

namespace pepeseg {
namespace {

constexpr int kMostPoints = 16'384;

// Returns whether the features of a prompt's query depend on the threshold.
bool FitsThreshold(const Shape& shape) {
  return std::holds_alternative<BoxPrompt>(shape) || std::holds_alternative<BinaryMask>(shape);
}

absl::StatusOr<EntityQueries> QueriesOfPrompt(const QueryTask& query_task,
                                              const ScoredEntity& entity) {
  const Segmenter& segmenter = query_task.segmenter;
  const Prompt prompt = PromptOf(query_task.task, entity);
  EntityQueries queries;
  for (const double scale : query_task.scales) {
    Granularity granularity = {.scale = scale};
    // Scored at every threshold: none is to be chosen.
    if (!FitsThreshold(prompt.what)) granularity.threshold = Query().threshold;
    ASSIGN_OR_RETURN(queries.by_scale.emplace_back(),
                     ResolvePrompt(segmenter, prompt, granularity));
  }
  ASSIGN_OR_RETURN(queries.automatic, ResolvePrompt(segmenter, prompt, {}));
  return queries;
}

// Returns the features that protocol "promptable" takes the mean of.
absl::StatusOr<std::vector<float>> FeaturesToMean(const Segmenter& segmenter,
                                                  const EvaluationTask& task,
                                                  const ScoredEntity& entity, int max_points) {
  const ModelView& view = task.views[entity.reference].view;
  std::vector<int32_t> pixels;
  const auto* shape = std::get_if<Shape>(&entity.prompt);
  if (const PointsPrompt* points = shape != nullptr ? PointsOf(*shape) : nullptr) {
    PointsPrompt positive = *points;
    std::erase_if(positive, [](const PointPrompt& point) { return !point.positive; });
    pixels = PixelsOf(positive, view.camera.width);
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
    prompt = PromptOf(task, entity);
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
