#include "core/evaluate/simulated_clicks.h"

#include <optional>
#include <utility>

#include "core/base/status_macros.h"
#include "core/evaluate/segmentation_metrics.h"
#include "core/prompt/resolve_prompt.h"
#include "core/query/mask_geometry.h"
#include "core/query/prompt.h"

namespace pepeseg {
namespace {

class Clicker {
 public:
  Clicker(const Segmenter& segmenter, const ClickTarget& target)
      : segmenter_(segmenter),
        target_(target),
        answer_(target.truth.size()),
        clicked_(target.truth.size()) {}

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
    SimulatedClick made = {.click = click, .query = {}};
    clicked_[static_cast<size_t>(click.y) * target_.view.camera.width +
             static_cast<size_t>(click.x)] = 1;
    points_.push_back(click);
    auto query = ResolvePrompt(segmenter_, {target_.view, points_}, {});
    if (IsNothingThere(query.status())) {
      points_.pop_back();
      made.on_nothing = true;
    } else {
      RETURN_IF_ERROR(query.status());
      query_ = *std::move(query);
      ASSIGN_OR_RETURN(auto results, segmenter_.Segment(query_, {&target_.view, 1}));
      answer_ = std::move(results[0].mask.pixels);
    }
    made.iou = Iou(answer_, target_.truth, target_.ignore);
    made.query = query_;
    return made;
  }

 private:
  const Segmenter& segmenter_;
  const ClickTarget& target_;
  std::vector<uint8_t> answer_, clicked_;  // [height, width]
  std::vector<PointPrompt> points_;        // clicks that are part of the prompt
  Query query_;                            // of points_
};

}  // namespace

absl::StatusOr<std::vector<SimulatedClick>> SimulateClicks(
    const Segmenter& segmenter, const ClickTarget& target, const ClickLimits& limits,
    absl::FunctionRef<absl::Status()> check_cancelled) {
  std::vector<SimulatedClick> clicks;
  Clicker clicker(segmenter, target);
  bool reached = false;
  for (int made = 1; made <= limits.max_clicks; ++made) {
    if (reached && made > limits.num_early_clicks) break;
    RETURN_IF_ERROR(check_cancelled());
    const std::optional<PointPrompt> click = clicker.Next();
    if (!click) break;
    ASSIGN_OR_RETURN(clicks.emplace_back(), clicker.Make(*click));
    reached = reached || clicks.back().iou >= limits.min_iou;
  }
  return clicks;
}

int ClicksUntil(std::span<const SimulatedClick> clicks, double min_iou) {
  for (size_t i = 0; i < clicks.size(); ++i) {
    if (clicks[i].iou >= min_iou) return static_cast<int>(i) + 1;
  }
  return 0;
}

}  // namespace pepeseg
