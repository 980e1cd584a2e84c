#include "tests/bench/prompt_scores.h"

#include <algorithm>
#include <chrono>
#include <string>
#include <utility>
#include <vector>

#include "core/base/status_macros.h"
#include "core/evaluate/scored_entities.h"
#include "core/evaluate/segmentation_metrics.h"
#include "core/prompt/resolve_prompt.h"
#include "core/select/select_gaussians.h"

namespace pepeseg {
namespace {

const LabeledView& Named(std::span<const LabeledView> views, const std::string& name) {
  return *std::ranges::find_if(views,
                               [&](const LabeledView& view) { return view.view.name == name; });
}

class EntityScorer {
 public:
  EntityScorer(const Segmenter& segmenter, std::span<const std::vector<LabeledView>> levels,
               size_t level, const EntityScore& entity)
      : segmenter_(segmenter), levels_(levels), views_(levels[level]), entity_(entity) {}

  absl::Status AddFirstProposal(const ProposalScore& first, PromptScores& sum) const {
    const Prompt prompt = {reference(), std::vector{entity_.click}};
    const auto start = std::chrono::steady_clock::now();
    RETURN_IF_ERROR(ResolvePrompt(segmenter_, prompt, {}).status());
    const std::chrono::duration<double, std::milli> took = std::chrono::steady_clock::now() - start;
    sum.choosing_ms += took.count();
    ASSIGN_OR_RETURN(const Query query,
                     ResolvePrompt(segmenter_, prompt, {first.scale, first.threshold}));
    ASSIGN_OR_RETURN(const double thing, ScoreAsAnyThing(query));
    sum.first_thing_iou += thing;
    return absl::OkStatus();
  }

  absl::Status AddMaskAndBox(PromptScores& sum) const {
    const BinaryMask mask = {Truth(Named(views_, entity_.views[0].view))};
    ASSIGN_OR_RETURN(const Query of_mask, ResolvePrompt(segmenter_, {reference(), mask}, {}));
    ASSIGN_OR_RETURN(const double mask_iou, Score(of_mask));
    sum.mask_iou += mask_iou;
    ASSIGN_OR_RETURN(const Query of_box, ResolvePrompt(segmenter_, {reference(), BoxOf(mask)}, {}));
    ASSIGN_OR_RETURN(const double box_iou, Score(of_box));
    sum.box_iou += box_iou;
    return AddSelection({{reference(), mask}, of_mask}, sum);
  }

 private:
  const ModelView& reference() const { return Named(views_, entity_.views[0].view).view; }
  std::vector<uint8_t> Truth(const LabeledView& view) const {
    return view.MaskOf(static_cast<uint16_t>(entity_.id));
  }

  BoxPrompt BoxOf(const BinaryMask& mask) const {
    const int width = reference().camera.width;
    int x0 = width, y0 = reference().camera.height, x1 = 0, y1 = 0;
    for (size_t i = 0; i < mask.pixels.size(); ++i) {
      if (mask.pixels[i] == 0) continue;
      const auto x = static_cast<int>(i % width), y = static_cast<int>(i / width);
      x0 = std::min(x0, x), x1 = std::max(x1, x + 1);
      y0 = std::min(y0, y), y1 = std::max(y1, y + 1);
    }
    return {double(x0), double(y0), double(x1 - x0), double(y1 - y0)};
  }

  // Returns the mean over the scored views.
  absl::StatusOr<double> Score(const Query& query) const {
    double sum = 0;
    for (size_t i = 1; i < entity_.views.size(); ++i) {
      ASSIGN_OR_RETURN(const double iou,
                       IouInView(segmenter_, query, Named(views_, entity_.views[i].view),
                                 static_cast<uint16_t>(entity_.id)));
      sum += iou;
    }
    return sum / static_cast<double>(entity_.views.size() - 1);
  }

  // Returns the best IoU over the levels, with the entity under the click there, in the scored
  // views.
  absl::StatusOr<double> ScoreAsAnyThing(const Query& query) const {
    double best = 0;
    for (const std::vector<LabeledView>& level : levels_) {
      const LabeledView& clicked = Named(level, entity_.views[0].view);
      const size_t pixel = static_cast<size_t>(entity_.click.y) * clicked.view.camera.width +
                           static_cast<size_t>(entity_.click.x);
      const uint16_t id = clicked.labels[pixel];
      if (id == 0) continue;
      double sum = 0;
      for (size_t i = 1; i < entity_.views.size(); ++i) {
        const LabeledView& view = Named(level, entity_.views[i].view);
        ASSIGN_OR_RETURN(const auto results, segmenter_.Segment(query, {&view.view, 1}));
        sum += Iou(results[0].mask.pixels, view.MaskOf(id), view.ignore);
      }
      best = std::max(best, sum / static_cast<double>(entity_.views.size() - 1));
    }
    return best;
  }

  absl::Status AddSelection(const SelectTask& task, PromptScores& sum) const {
    ASSIGN_OR_RETURN(const GaussianSet set,
                     SelectGaussians(segmenter_, task, [] { return absl::OkStatus(); }));
    const std::vector<int32_t> ids(set.member.begin(), set.member.end());
    const auto num_scored = static_cast<double>(entity_.views.size() - 1);
    for (size_t i = 1; i < entity_.views.size(); ++i) {
      const LabeledView& view = Named(views_, entity_.views[i].view);
      ASSIGN_OR_RETURN(const std::vector<int32_t> shown, segmenter_.RenderIds(view.view, ids));
      const std::vector<uint8_t> back(shown.begin(), shown.end());
      ASSIGN_OR_RETURN(const auto masks, segmenter_.Segment(task.query, {&view.view, 1}));
      sum.selection_iou += Iou(back, Truth(view), view.ignore) / num_scored;
      sum.selection_against_masks += Iou(back, masks[0].mask.pixels) / num_scored;
    }
    return absl::OkStatus();
  }

  const Segmenter& segmenter_;
  const std::span<const std::vector<LabeledView>> levels_;
  const std::span<const LabeledView> views_;  // labels of the entity's level
  const EntityScore& entity_;
};

}  // namespace

absl::StatusOr<PromptScores> ScorePrompts(const Segmenter& segmenter,
                                          std::span<const std::vector<LabeledView>> levels,
                                          size_t level, std::span<const EntityScore> entities,
                                          const ProposalScores& proposals) {
  PromptScores sum;
  for (size_t i = 0; i < entities.size(); ++i) {
    const EntityScorer scorer(segmenter, levels, level, entities[i]);
    const std::vector<ProposalScore>& clicked = proposals.entities[i].proposals;
    if (!clicked.empty()) RETURN_IF_ERROR(scorer.AddFirstProposal(clicked[0], sum));
    RETURN_IF_ERROR(scorer.AddMaskAndBox(sum));
  }
  const auto count = static_cast<double>(entities.size());
  for (double* value : {&sum.choosing_ms, &sum.first_thing_iou, &sum.mask_iou, &sum.box_iou,
                        &sum.selection_iou, &sum.selection_against_masks}) {
    *value /= count;
  }
  return sum;
}

}  // namespace pepeseg
