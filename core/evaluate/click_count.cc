#include "core/evaluate/click_count.h"

#include <algorithm>
#include <optional>
#include <utility>

#include "absl/strings/str_cat.h"
#include "core/base/status_macros.h"
#include "core/evaluate/scored_entities.h"
#include "core/evaluate/segmentation_metrics.h"
#include "core/prompt/resolve_prompt.h"
#include "core/query/check_prompt.h"
#include "core/query/mask_geometry.h"

namespace pepeseg {
namespace {

constexpr int kMostClicks = 256;  // limit of points in a prompt, see CheckPoints

// Simulates a person who clicks on one entity until the mask is right.
class Clicker {
 public:
  Clicker(const Segmenter& segmenter, const ShownEntity& entity)
      : segmenter_(segmenter),
        entity_(entity),
        reference_(*entity.views[0]),
        truth_(reference_.MaskOf(entity.id)),
        answer_(truth_.size()),
        clicked_(truth_.size()) {}

  // Returns the next click, or nothing if no wrong pixel is left to click.
  std::optional<PointPrompt> Next() const {
    if (points_.empty() && num_refused_ == 0) return FirstClick(entity_);
    std::vector<uint8_t> missed(truth_.size()), spilled(truth_.size());
    for (size_t i = 0; i < truth_.size(); ++i) {
      if (!reference_.Counts(i) || clicked_[i] != 0) continue;
      missed[i] = truth_[i] != 0 && answer_[i] == 0 ? 1 : 0;
      spilled[i] = truth_[i] == 0 && answer_[i] != 0 ? 1 : 0;
    }
    const Camera& camera = reference_.view.camera;
    const DeepPixel in = FindDeepest(missed, camera.width, camera.height);
    const DeepPixel out = FindDeepest(spilled, camera.width, camera.height);
    if (in.squared_depth == 0 && out.squared_depth == 0) return std::nullopt;
    const bool positive = in.squared_depth >= out.squared_depth;
    const PixelIndex& at = positive ? in.pixel : out.pixel;
    return PointPrompt{at.x + 0.5, at.y + 0.5, positive};
  }

  // Makes the click and scores the mask of all clicks so far. A click on nothing is left out of the
  // prompt, so that the mask stays as it was.
  absl::StatusOr<ClickAnswer> Make(const PointPrompt& click) {
    ClickAnswer answer = {.click = click};
    clicked_[static_cast<size_t>(click.y) * reference_.view.camera.width +
             static_cast<size_t>(click.x)] = 1;
    points_.push_back(click);
    auto query = ResolvePrompt(segmenter_, {reference_.view, points_}, {});
    if (IsNothingThere(query.status())) {
      points_.pop_back();
      ++num_refused_;
      answer.on_nothing = true;
    } else {
      RETURN_IF_ERROR(query.status());
      ASSIGN_OR_RETURN(auto results, segmenter_.Segment(*query, {&reference_.view, 1}));
      answer_ = std::move(results[0].mask.pixels);
      ASSIGN_OR_RETURN(iou_, MeanScoredIou(segmenter_, *query, entity_));
    }
    answer.reference_iou = Iou(answer_, truth_, reference_.ignore);
    answer.iou = iou_;
    return answer;
  }

 private:
  const Segmenter& segmenter_;
  const ShownEntity& entity_;
  const LabeledView& reference_;
  const std::vector<uint8_t> truth_;
  std::vector<uint8_t> answer_, clicked_;  // [height, width] of the reference
  std::vector<PointPrompt> points_;        // clicks that are part of the prompt
  int num_refused_ = 0;
  double iou_ = 0;  // of the last mask, mean over the scored views
};

absl::StatusOr<EntityClicks> Score(const Segmenter& segmenter, const ShownEntity& entity,
                                   const ClickOptions& options,
                                   absl::FunctionRef<absl::Status()> check_cancelled) {
  EntityClicks score = {.id = entity.id, .num_clicks = options.max_clicks, .answers = {}};
  Clicker clicker(segmenter, entity);
  for (int made = 1; made <= options.max_clicks; ++made) {
    if (score.reached && made > kNumEarlyClicks) break;
    RETURN_IF_ERROR(check_cancelled());
    const std::optional<PointPrompt> click = clicker.Next();
    if (!click) break;
    ASSIGN_OR_RETURN(const ClickAnswer answer, clicker.Make(*click));
    score.answers.push_back(answer);
    if (!score.reached && answer.reference_iou >= options.min_iou) {
      score.reached = true;
      score.num_clicks = made;
    }
  }
  for (size_t k = 0; k < score.iou_after.size(); ++k) {
    score.iou_after[k] = score.answers[std::min(k, score.answers.size() - 1)].iou;
  }
  return score;
}

}  // namespace

absl::Status Validate(const ClickOptions& options) {
  if (!(options.min_iou > 0 && options.min_iou <= 1)) {
    return absl::InvalidArgumentError(
        absl::StrCat("min_iou is ", options.min_iou, ", must be in (0, 1]"));
  }
  if (options.max_clicks < kNumEarlyClicks || options.max_clicks > kMostClicks) {
    return absl::InvalidArgumentError(absl::StrCat("max_clicks is ", options.max_clicks,
                                                   ", must be in [", kNumEarlyClicks, ", ",
                                                   kMostClicks, "]"));
  }
  if (options.min_pixels >= 1) return absl::OkStatus();
  return absl::InvalidArgumentError(
      absl::StrCat("min_pixels is ", options.min_pixels, ", must be at least 1"));
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

}  // namespace pepeseg
