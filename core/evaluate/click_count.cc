#include "core/evaluate/click_count.h"

#include <algorithm>
#include <utility>

#include "absl/strings/str_cat.h"
#include "core/base/status_macros.h"
#include "core/evaluate/scored_entities.h"
#include "core/evaluate/segmentation_metrics.h"
#include "core/evaluate/simulated_clicks.h"

namespace pepeseg {
namespace {

constexpr int kMostClicks = 256;  // limit of points in a prompt, see CheckPoints

// Returns the clicks without scores in other views.
EntityClicks EntityOf(std::span<const SimulatedClick> clicks, const ClickOptions& options) {
  EntityClicks score = {.num_clicks = ClicksUntil(clicks, options.min_iou), .answers = {}};
  score.reached = score.num_clicks > 0;
  if (!score.reached) score.num_clicks = options.max_clicks;
  for (const SimulatedClick& click : clicks) {
    score.answers.push_back({click.click, click.on_nothing, click.iou, 0});
  }
  return score;
}

// Adds the IoU of each click's mask in one view, with the truth there.
absl::Status AddView(const Segmenter& segmenter, std::span<const SimulatedClick> clicks,
                     const ClickTarget& target, EntityClicks& score) {
  double iou = 0;  // before the first click on something
  for (size_t i = 0; i < clicks.size(); ++i) {
    if (!clicks[i].on_nothing) {
      ASSIGN_OR_RETURN(const auto results, segmenter.Segment(clicks[i].query, {&target.view, 1}));
      iou = Iou(results[0].mask.pixels, target.truth, target.ignore);
    }
    score.answers[i].iou += iou;
  }
  return absl::OkStatus();
}

// Turns sums over the scored views into means.
void TakeMeans(size_t num_views, EntityClicks& score) {
  for (ClickAnswer& answer : score.answers) answer.iou /= static_cast<double>(num_views);
  if (score.answers.empty()) return;
  for (size_t k = 0; k < score.iou_after.size(); ++k) {
    score.iou_after[k] = score.answers[std::min(k, score.answers.size() - 1)].iou;
  }
}

absl::StatusOr<EntityClicks> Score(const Segmenter& segmenter, const ShownEntity& entity,
                                   const ClickOptions& options,
                                   absl::FunctionRef<absl::Status()> check_cancelled) {
  const LabeledView& reference = *entity.views[0];
  const std::vector<uint8_t> truth = reference.MaskOf(entity.id);
  ASSIGN_OR_RETURN(
      const std::vector<SimulatedClick> clicks,
      SimulateClicks(segmenter, {reference.view, truth, reference.ignore},
                     {options.min_iou, options.max_clicks, kNumEarlyClicks}, check_cancelled));
  EntityClicks score = EntityOf(clicks, options);
  score.id = entity.id;
  for (size_t v = 1; v < entity.views.size(); ++v) {
    const LabeledView& view = *entity.views[v];
    const std::vector<uint8_t> here = view.MaskOf(entity.id);
    RETURN_IF_ERROR(AddView(segmenter, clicks, {view.view, here, view.ignore}, score));
  }
  TakeMeans(entity.views.size() - 1, score);
  return score;
}

absl::Status CheckPrompts(const EvaluationTask& task) {
  for (const ScoredEntity& entity : task.entities) {
    if (std::holds_alternative<DeepestClick>(entity.prompt)) continue;
    return InReference(task, entity,
                       absl::InvalidArgumentError("the protocol \"clicks\" makes its own prompt; "
                                                  "give none, or DeepestClick"));
  }
  return absl::OkStatus();
}

}  // namespace

absl::Status Validate(const ClickOptions& options) {
  if (!(options.min_iou > 0 && options.min_iou <= 1)) {
    return absl::InvalidArgumentError(
        absl::StrCat("clicks.min_iou is ", options.min_iou, ", must be in (0, 1]"));
  }
  if (options.max_clicks < kNumEarlyClicks || options.max_clicks > kMostClicks) {
    return absl::InvalidArgumentError(absl::StrCat("clicks.max_clicks is ", options.max_clicks,
                                                   ", must be in [", kNumEarlyClicks, ", ",
                                                   kMostClicks, "]"));
  }
  if (options.min_pixels >= 1) return absl::OkStatus();
  return absl::InvalidArgumentError(
      absl::StrCat("clicks.min_pixels is ", options.min_pixels, ", must be at least 1"));
}

absl::StatusOr<ClickScores> EvaluateClicks(const Segmenter& segmenter,
                                           std::span<const LabeledView> views,
                                           const ClickOptions& options,
                                           absl::FunctionRef<absl::Status()> check_cancelled) {
  RETURN_IF_ERROR(Validate(options));
  ASSIGN_OR_RETURN(const ScoredEntities found, FindScoredEntities(views, options.min_pixels));
  const auto count = static_cast<double>(found.entities.size());
  ClickScores scores;
  for (const ShownEntity& entity : found.entities) {
    ASSIGN_OR_RETURN(EntityClicks score, Score(segmenter, entity, options, check_cancelled));
    scores.num_clicks += score.num_clicks / count;
    scores.reached += (score.reached ? 1 : 0) / count;
    for (size_t k = 0; k < score.iou_after.size(); ++k) {
      scores.iou_after[k] += score.iou_after[k] / count;
    }
    scores.entities.push_back(std::move(score));
  }
  return scores;
}

// First the clicks, reference view by reference view, then the scores, scored view by scored view:
// each feature map serves all entities.
absl::StatusOr<std::vector<EntityClicks>> CountClicks(
    const Segmenter& segmenter, const EvaluationTask& task, const ClickOptions& options,
    absl::FunctionRef<absl::Status()> check_cancelled) {
  RETURN_IF_ERROR(Validate(options));
  RETURN_IF_ERROR(CheckPrompts(task));
  const ClickLimits limits = {options.min_iou, options.max_clicks, kNumEarlyClicks};
  std::vector<std::vector<SimulatedClick>> clicks(task.entities.size());
  for (size_t v = 0; v < task.views.size(); ++v) {
    const TruthView& truth = task.views[v];
    for (size_t i = 0; i < task.entities.size(); ++i) {
      if (task.entities[i].reference != v) continue;
      const std::vector<uint8_t> mask = truth.CountedMaskOf(task.entities[i].name);
      const ClickTarget target = {truth.view, mask, truth.ignore};
      ASSIGN_OR_RETURN(clicks[i], SimulateClicks(segmenter, target, limits, check_cancelled));
    }
  }
  std::vector<EntityClicks> scores;
  scores.reserve(clicks.size());
  for (const auto& of_entity : clicks) scores.push_back(EntityOf(of_entity, options));
  for (size_t v = 0; v < task.views.size(); ++v) {
    const TruthView& truth = task.views[v];
    for (size_t i = 0; i < task.entities.size(); ++i) {
      const ScoredEntity& entity = task.entities[i];
      if (std::find(entity.scored.begin(), entity.scored.end(), v) == entity.scored.end()) continue;
      RETURN_IF_ERROR(check_cancelled());
      const std::vector<uint8_t> mask = truth.MaskOf(entity.name);
      RETURN_IF_ERROR(AddView(segmenter, clicks[i], {truth.view, mask, truth.ignore}, scores[i]));
    }
  }
  for (size_t i = 0; i < scores.size(); ++i) TakeMeans(task.entities[i].scored.size(), scores[i]);
  return scores;
}

}  // namespace pepeseg
