#include "core/evaluate/evaluate.h"

#include <map>
#include <span>
#include <utility>

#include "absl/strings/str_cat.h"
#include "core/base/status_macros.h"

namespace pepeseg {
namespace {

constexpr size_t kMostValues = 100;

absl::Status CheckAscends(absl::string_view name, const std::vector<double>& values, double low) {
  if (values.empty() || values.size() > kMostValues) {
    return absl::InvalidArgumentError(
        absl::StrCat(name, " has ", values.size(), " values, must have 1..", kMostValues));
  }
  for (size_t i = 0; i < values.size(); ++i) {
    const bool ascends = i == 0 || values[i] > values[i - 1];
    if (values[i] >= low && values[i] <= 1 && ascends) continue;  // false for NaN
    return absl::InvalidArgumentError(
        absl::StrCat(name, "[", i, "] is ", values[i], ", must be in [", low, ", 1] and ascend"));
  }
  return absl::OkStatus();
}

bool PropagatesLabels(Protocol protocol) {
  return protocol == Protocol::kLabelPropagation || protocol == Protocol::kLabelPropagationPixels;
}

// Returns the thresholds that a protocol may choose from.
ChoiceThresholds ThresholdsOf(const EvaluationOptions& options) {
  if (PropagatesLabels(options.protocol)) {
    const double threshold = options.label_propagation.min_cosine;
    return {{threshold}, ReferenceRule::kBest, threshold};
  }
  if (options.protocol == Protocol::kPromptable) {
    const double threshold = options.promptable.min_cosine;
    return {{threshold}, ReferenceRule::kBest, threshold};
  }
  return {options.thresholds, ReferenceRule::kCenter, options.fixed_threshold};
}

absl::StatusOr<std::vector<EntityQueries>> QueriesOf(const QueryTask& query_task,
                                                     const EvaluationOptions& options) {
  if (PropagatesLabels(options.protocol)) {
    return LabelPropagationQueries(query_task, options.label_propagation);
  }
  if (options.protocol == Protocol::kPromptable)
    return PromptableQueries(query_task, options.promptable);
  return PromptQueries(query_task);
}

absl::StatusOr<std::vector<EntityScores>> ScoresOf(const QueryTask& query_task,
                                                   std::span<const EntityQueries> queries,
                                                   const EvaluationOptions& options) {
  const ChoiceThresholds choice = ThresholdsOf(options);
  if (options.protocol != Protocol::kLabelPropagation) {
    return ScoreQueries(query_task, queries, choice);
  }
  PropagatedMasks masks(query_task, options.label_propagation);
  return ScoreQueries(query_task, queries, choice,
                      [&](size_t view, const Query& query) { return masks.In(view, query); });
}

absl::StatusOr<std::vector<EntityScores>> ClickScoresOf(
    const Segmenter& segmenter, const EvaluationTask& task, const EvaluationOptions& options,
    ImageSegmenter* images, absl::FunctionRef<absl::Status()> check_cancelled) {
  ASSIGN_OR_RETURN(
      std::vector<EntityClicks> clicks,
      CountClicks(segmenter, task, options.clicks, {.refine_borders = options.refine_borders},
                  images, check_cancelled));
  std::vector<EntityScores> scores;
  for (size_t i = 0; i < clicks.size(); ++i) {
    scores.push_back(WithoutScores(task, task.entities[i]));
    scores.back().clicks = std::move(clicks[i]);
  }
  return scores;
}

void AddClicks(const EntityClicks& clicks, GroupScores& sum) {
  sum.num_clicks += clicks.num_clicks;
  sum.reached += clicks.reached ? 1 : 0;
  for (size_t k = 0; k < sum.iou_after.size(); ++k) sum.iou_after[k] += clicks.iou_after[k];
}

GroupScores GroupOf(std::string name, const std::vector<const EntityScores*>& entities) {
  GroupScores group;
  group.name = std::move(name);
  group.num_entities = static_cast<int>(entities.size());
  std::vector<MaskScores> paper, automatic, reference;
  for (const EntityScores* entity : entities) {
    paper.push_back(entity->paper.mean);
    automatic.push_back(entity->automatic.mean);
    if (entity->reference_choice) reference.push_back(entity->reference_choice->mean);
    group.iou_by_scale.resize(entity->iou_by_scale.size());
    for (size_t s = 0; s < group.iou_by_scale.size(); ++s) {
      group.iou_by_scale[s] += entity->iou_by_scale[s];
    }
    if (entity->clicks) AddClicks(*entity->clicks, group);
  }
  const auto count = static_cast<double>(entities.size());
  group.paper = MeanOf(paper);
  group.automatic = MeanOf(automatic);
  if (!reference.empty()) group.reference_choice = MeanOf(reference);
  for (double& iou : group.iou_by_scale) iou /= count;
  group.num_clicks /= count;
  group.reached /= count;
  for (double& iou : group.iou_after) iou /= count;
  return group;
}

// Fills in the means over categories and over all entities.
void TakeMeansOfGroups(EvaluationResult& result) {
  std::map<std::string, std::vector<const EntityScores*>> by_category;
  std::vector<const EntityScores*> all;
  for (const EntityScores& entity : result.entities) {
    by_category[entity.category].push_back(&entity);
    all.push_back(&entity);
  }
  for (const auto& [category, entities] : by_category) {
    result.categories.push_back(GroupOf(category, entities));
  }
  result.scene = GroupOf("", all);
}

}  // namespace

absl::Status Validate(const EvaluationOptions& options) {
  RETURN_IF_ERROR(CheckAscends("scales", options.scales, 0));
  RETURN_IF_ERROR(CheckAscends("thresholds", options.thresholds, -1));
  if (!(options.fixed_threshold >= -1 && options.fixed_threshold <= 1)) {
    return absl::InvalidArgumentError(
        absl::StrCat("fixed_threshold is ", options.fixed_threshold, ", must be in [-1, 1]"));
  }
  if (options.task.min_pixels < 1) {
    return absl::InvalidArgumentError(
        absl::StrCat("min_pixels is ", options.task.min_pixels, ", must be at least 1"));
  }
  RETURN_IF_ERROR(Validate(options.label_propagation));
  RETURN_IF_ERROR(Validate(options.promptable));
  RETURN_IF_ERROR(Validate(options.clicks));
  return Validate(options.sam);
}

absl::StatusOr<EvaluationResult> Evaluate(const Segmenter& segmenter, EvaluationRequest request,
                                          const EvaluationOptions& options,
                                          absl::FunctionRef<absl::Status()> check_cancelled,
                                          ImageSegmenter* images) {
  RETURN_IF_ERROR(Validate(options));
  EvaluationResult result;
  if (options.protocol == Protocol::kSamAgreement) {
    for (const SamView& sam : request.sam_views) {
      RETURN_IF_ERROR(CheckHeldOut(sam.view, request.accept_trained_views));
    }
    ASSIGN_OR_RETURN(
        result.sam, ScoreSamAgreement(segmenter, request.sam_views, options.sam,
                                      {.refine_borders = options.refine_borders}, check_cancelled));
    return result;
  }
  ASSIGN_OR_RETURN(EvaluationTask task, MakeTask(std::move(request), options.task));
  if (options.protocol == Protocol::kClicks) {
    ASSIGN_OR_RETURN(result.entities,
                     ClickScoresOf(segmenter, task, options, images, check_cancelled));
  } else {
    const QueryTask query_task = {segmenter, task, options.scales, check_cancelled,
                                  options.refine_borders};
    ASSIGN_OR_RETURN(const std::vector<EntityQueries> queries, QueriesOf(query_task, options));
    ASSIGN_OR_RETURN(result.entities, ScoresOf(query_task, queries, options));
  }
  result.left_out = std::move(task.left_out);
  for (const TruthView& truth : task.views) result.num_void += truth.num_void;
  TakeMeansOfGroups(result);
  return result;
}

}  // namespace pepeseg
