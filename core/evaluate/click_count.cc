#include "core/evaluate/click_count.h"

#include <algorithm>
#include <cstdint>
#include <optional>
#include <span>
#include <utility>

#include "absl/strings/str_cat.h"
#include "core/base/status_macros.h"
#include "core/evaluate/mask_scores.h"
#include "core/query/prompted_thing.h"
#include "core/query/mask_geometry.h"
#include "core/query/prompt.h"
#include "core/query/resolve_prompt.h"

namespace pepeseg {
namespace {

constexpr int kMostClicks = 256;

// An entity in one view. The spans must outlive the simulation.
struct ClickTarget {
  const ModelView& view;
  std::span<const uint8_t> truth;   // [height, width] of 0 and 1; 0 where ignored
  std::span<const uint8_t> ignore;  // as TruthView::ignore; ignored pixels are not clicked, either
};

// The model, the images and the options that answer clicks.
struct Answering {
  const Segmenter& segmenter;
  ImageSegmenter* images;  // may be null
  const SegmentOptions& segment;
  WantedCheck check;
};

// Returns the mask of a thing in a view.
absl::StatusOr<BinaryMask> MaskIn(const Answering& by, const ModelView& view, PromptedThing& thing) {
  ASSIGN_OR_RETURN(SegmentResult result, thing.In(view, by.segment, by.check));
  return std::move(result.mask);
}

// A click, and the meaning of it and all clicks before it.
struct SimulatedClick {
  PointPrompt click;                  // pixels of the view
  bool on_nothing = false;            // see ClickAnswer
  double iou = 0;                     // on the clicked view
  std::optional<PromptedThing> thing;  // absent: all clicks so far are on nothing
};

class Clicker {
 public:
  Clicker(const Answering& by, const ClickTarget& target)
      : by_(by), target_(target), answer_(target.truth.size()), clicked_(target.truth.size()) {}

  // Returns the next click, or nothing if no wrong pixel is left to click. Before the first click
  // all of the entity is missed.
  std::optional<PointPrompt> Next() const {
    const std::span<const uint8_t> truth = target_.truth;
    std::vector<uint8_t> missed(truth.size()), spilled(truth.size());
    for (size_t i = 0; i < truth.size(); ++i) {
      const bool counts = target_.ignore.empty() || target_.ignore[i] == 0;
      if (!counts || clicked_[i] != 0) continue;
      missed[i] = truth[i] != 0 && answer_[i] == 0 ? 1 : 0;
      spilled[i] = truth[i] == 0 && answer_[i] != 0 ? 1 : 0;
    }
    const Camera& camera = target_.view.camera;
    const DeepPixel in = FindDeepest(missed, camera.width, camera.height);
    const DeepPixel out = FindDeepest(spilled, camera.width, camera.height);
    if (in.squared_depth == 0 && out.squared_depth == 0) return std::nullopt;
    const bool positive = in.squared_depth >= out.squared_depth;
    const PixelIndex& at = positive ? in.pixel : out.pixel;
    return PointPrompt{at.x + 0.5, at.y + 0.5, positive};
  }

  // Makes the click. A click on nothing is left out of the prompt, so that the mask stays as it
  // was.
  absl::StatusOr<SimulatedClick> Make(const PointPrompt& click) {
    SimulatedClick made = {.click = click, .thing = {}};
    clicked_[static_cast<size_t>(click.y) * target_.view.camera.width +
             static_cast<size_t>(click.x)] = 1;
    points_.push_back(click);
    auto thing =
        PromptedThing::Find(by_.segmenter, by_.images, {target_.view, points_}, {}, by_.check);
    if (IsNothingThere(thing.status())) {
      points_.pop_back();
      made.on_nothing = true;
    } else {
      RETURN_IF_ERROR(thing.status());
      thing_ = *std::move(thing);
      ASSIGN_OR_RETURN(BinaryMask mask, MaskIn(by_, target_.view, *thing_));
      answer_ = std::move(mask.pixels);
    }
    made.iou = Iou(answer_, target_.truth, target_.ignore);
    made.thing = thing_;
    return made;
  }

 private:
  const Answering& by_;
  const ClickTarget& target_;
  std::vector<uint8_t> answer_, clicked_;  // [height, width]
  std::vector<PointPrompt> points_;        // clicks that are part of the prompt
  std::optional<PromptedThing> thing_;      // of points_
};

// Returns the clicks on a target, in order.
absl::StatusOr<std::vector<SimulatedClick>> SimulateClicks(const Answering& by,
                                                           const ClickTarget& target,
                                                           const ClickOptions& options) {
  std::vector<SimulatedClick> clicks;
  Clicker clicker(by, target);
  bool reached = false;
  for (int made = 1; made <= options.max_clicks; ++made) {
    if (reached && made > kNumEarlyClicks) break;
    RETURN_IF_ERROR(by.check());
    const std::optional<PointPrompt> click = clicker.Next();
    if (!click) break;
    ASSIGN_OR_RETURN(clicks.emplace_back(), clicker.Make(*click));
    reached = reached || clicks.back().iou >= options.min_iou;
  }
  return clicks;
}

// Returns the number of clicks until min_iou, or 0 if it was never reached.
int ClicksUntil(std::span<const SimulatedClick> clicks, double min_iou) {
  for (size_t i = 0; i < clicks.size(); ++i) {
    if (clicks[i].iou >= min_iou) return static_cast<int>(i) + 1;
  }
  return 0;
}

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
absl::Status AddView(const Answering& by, std::span<SimulatedClick> clicks,
                     const ClickTarget& target, EntityClicks& score) {
  double iou = 0;  // before the first click on something
  for (size_t i = 0; i < clicks.size(); ++i) {
    if (!clicks[i].on_nothing) {
      ASSIGN_OR_RETURN(const BinaryMask mask, MaskIn(by, target.view, *clicks[i].thing));
      iou = Iou(mask.pixels, target.truth, target.ignore);
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
  if (options.max_clicks >= kNumEarlyClicks && options.max_clicks <= kMostClicks) {
    return absl::OkStatus();
  }
  return absl::InvalidArgumentError(absl::StrCat("clicks.max_clicks is ", options.max_clicks,
                                                 ", must be in [", kNumEarlyClicks, ", ",
                                                 kMostClicks, "]"));
}

// First the clicks, reference view by reference view, then the scores, scored view by scored view:
// each feature map serves all entities.
absl::StatusOr<std::vector<EntityClicks>> CountClicks(
    const Segmenter& segmenter, const EvaluationTask& task, const ClickOptions& options,
    const SegmentOptions& segment, ImageSegmenter* images,
    absl::FunctionRef<absl::Status()> check_cancelled) {
  RETURN_IF_ERROR(Validate(options));
  RETURN_IF_ERROR(CheckPrompts(task));
  const Answering by = {segmenter, images, segment, [&] { return check_cancelled(); }};
  std::vector<std::vector<SimulatedClick>> clicks(task.entities.size());
  for (size_t v = 0; v < task.views.size(); ++v) {
    const TruthView& truth = task.views[v];
    for (size_t i = 0; i < task.entities.size(); ++i) {
      if (task.entities[i].reference != v) continue;
      const std::vector<uint8_t> mask = truth.CountedMaskOf(task.entities[i].name);
      const ClickTarget target = {truth.view, mask, truth.ignore};
      ASSIGN_OR_RETURN(clicks[i], SimulateClicks(by, target, options));
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
      RETURN_IF_ERROR(by.check());
      const std::vector<uint8_t> mask = truth.MaskOf(entity.name);
      RETURN_IF_ERROR(AddView(by, clicks[i], {truth.view, mask, truth.ignore}, scores[i]));
    }
  }
  for (size_t i = 0; i < scores.size(); ++i) TakeMeans(task.entities[i].scored.size(), scores[i]);
  return scores;
}

}  // namespace pepeseg
