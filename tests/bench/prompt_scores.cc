#include "tests/bench/prompt_scores.h"

#include <algorithm>
#include <string>
#include <utility>
#include <vector>

#include "core/base/status_macros.h"
#include "core/evaluate/entity_queries.h"
#include "core/evaluate/mask_scores.h"
#include "core/query/prompt.h"
#include "core/query/propose.h"
#include "core/query/resolve_prompt.h"
#include "core/query/select_gaussians.h"
#include "tests/bench/bench_clock.h"
#include "tests/bench/truth_views.h"

namespace pepeseg {
namespace {

constexpr size_t kNumLookedAt = 3;  // proposals that the person compares

const TruthView& Named(std::span<const TruthView> views, const std::string& name) {
  return *std::ranges::find_if(views,
                               [&](const TruthView& view) { return view.view.name == name; });
}

// Returns the scored IoU of the proposal that is best on the reference, the earlier one among
// equals, or 0 if none overlaps the entity there.
double BestOf(std::span<const ProposalScore> proposals) {
  ProposalScore best;
  for (const ProposalScore& proposal : proposals) {
    if (proposal.reference_iou > best.reference_iou) best = proposal;
  }
  return best.iou;
}

class EntityScorer {
 public:
  EntityScorer(const Segmenter& segmenter, const EvaluationTask& task, const ScoredEntity& entity)
      : segmenter_(segmenter),
        task_(task),
        entity_(entity),
        reference_(task.views[entity.reference]),
        click_(DeepestClickOf(task, entity)) {}

  absl::StatusOr<EntityProposals> Propose() const {
    EntityProposals score;
    const auto proposed =
        pepeseg::Propose(segmenter_, {.prompt = Click(), .frame = FrameKind::kView});
    if (IsNothingThere(proposed.status())) return score;
    RETURN_IF_ERROR(proposed.status());
    const std::vector<uint8_t> mask = reference_.MaskOf(entity_.name);
    for (const size_t i : proposed->candidates.BySupport()) {
      const SegmentResult& result = proposed->masks[i];
      ASSIGN_OR_RETURN(const Query query,
                       ResolvePrompt(segmenter_, Click(), {result.scale, result.threshold}));
      ASSIGN_OR_RETURN(const double iou, Score(query));
      score.proposals.push_back({result.scale, result.threshold,
                                 proposed->candidates.list[i].support,
                                 Iou(result.mask.pixels, mask, reference_.ignore), iou});
    }
    const std::span<const ProposalScore> all = score.proposals;
    if (!all.empty()) score.first_iou = all[0].iou;
    score.best_of_three_iou = BestOf(all.first(std::min(kNumLookedAt, all.size())));
    score.best_iou = BestOf(all);
    return score;
  }

  absl::Status AddFirstProposal(const ProposalScore& first,
                                std::span<const std::vector<TruthView>> levels,
                                PromptScores& sum) const {
    const double start = NowMs();
    RETURN_IF_ERROR(ResolvePrompt(segmenter_, Click(), {}).status());
    sum.choosing_ms += NowMs() - start;
    ASSIGN_OR_RETURN(const Query query,
                     ResolvePrompt(segmenter_, Click(), {first.scale, first.threshold}));
    ASSIGN_OR_RETURN(const double thing, ScoreAsAnyThing(query, levels));
    sum.first_thing_iou += thing;
    return absl::OkStatus();
  }

  absl::Status AddMaskAndBox(PromptScores& sum) const {
    const BinaryMask mask = {reference_.CountedMaskOf(entity_.name)};
    ASSIGN_OR_RETURN(const Query of_mask, ResolvePrompt(segmenter_, {reference_.view, mask}, {}));
    ASSIGN_OR_RETURN(const double mask_iou, Score(of_mask));
    sum.mask_iou += mask_iou;
    ASSIGN_OR_RETURN(const Query of_box,
                     ResolvePrompt(segmenter_, {reference_.view, BoxOf(mask)}, {}));
    ASSIGN_OR_RETURN(const double box_iou, Score(of_box));
    sum.box_iou += box_iou;
    return AddSelection({.prompt = {reference_.view, mask}}, of_mask, sum);
  }

 private:
  Prompt Click() const { return {reference_.view, std::vector{click_}}; }

  BoxPrompt BoxOf(const BinaryMask& mask) const {
    const int width = reference_.view.camera.width;
    int x0 = width, y0 = reference_.view.camera.height, x1 = 0, y1 = 0;
    for (size_t i = 0; i < mask.pixels.size(); ++i) {
      if (mask.pixels[i] == 0) continue;
      const auto x = static_cast<int>(i % width), y = static_cast<int>(i / width);
      x0 = std::min(x0, x), x1 = std::max(x1, x + 1);
      y0 = std::min(y0, y), y1 = std::max(y1, y + 1);
    }
    return {double(x0), double(y0), double(x1 - x0), double(y1 - y0)};
  }

  absl::StatusOr<double> IouIn(const TruthView& truth, const std::string& entity,
                               const Query& query) const {
    ASSIGN_OR_RETURN(const auto results, segmenter_.Segment(query, {&truth.view, 1}));
    return Iou(results[0].mask.pixels, MaskIn(truth, entity), truth.ignore);
  }

  // Returns the mean over the scored views.
  absl::StatusOr<double> Score(const Query& query) const {
    double sum = 0;
    for (const size_t v : entity_.scored) {
      ASSIGN_OR_RETURN(const double iou, IouIn(task_.views[v], entity_.name, query));
      sum += iou;
    }
    return sum / static_cast<double>(entity_.scored.size());
  }

  // Returns the best IoU over the levels, with the entity under the click there, in the scored
  // views.
  absl::StatusOr<double> ScoreAsAnyThing(const Query& query,
                                         std::span<const std::vector<TruthView>> levels) const {
    double best = 0;
    const int64_t pixel = static_cast<int64_t>(click_.y) * reference_.view.camera.width +
                          static_cast<int64_t>(click_.x);
    for (const std::vector<TruthView>& level : levels) {
      const TruthView& clicked = Named(level, reference_.view.name);
      const auto under_click = std::ranges::find_if(clicked.entities, [&](const std::string& name) {
        return clicked.MaskOf(name)[static_cast<size_t>(pixel)] != 0;
      });
      if (under_click == clicked.entities.end()) continue;
      double sum = 0;
      for (const size_t v : entity_.scored) {
        ASSIGN_OR_RETURN(const double iou,
                         IouIn(Named(level, task_.views[v].view.name), *under_click, query));
        sum += iou;
      }
      best = std::max(best, sum / static_cast<double>(entity_.scored.size()));
    }
    return best;
  }

  absl::Status AddSelection(const SelectRequest& select, const Query& query,
                            PromptScores& sum) const {
    const auto mask_in = [&](const ModelView& view) -> absl::StatusOr<SegmentResult> {
      ASSIGN_OR_RETURN(auto results, segmenter_.Segment(query, {&view, 1}));
      return std::move(results.front());
    };
    ASSIGN_OR_RETURN(const GaussianSet set,
                     SelectGaussians(segmenter_, select, mask_in, [] { return absl::OkStatus(); }));
    const std::vector<int32_t> ids(set.member.begin(), set.member.end());
    const auto num_scored = static_cast<double>(entity_.scored.size());
    for (const size_t v : entity_.scored) {
      const TruthView& truth = task_.views[v];
      ASSIGN_OR_RETURN(const std::vector<int32_t> shown, segmenter_.RenderIds(truth.view, ids));
      const std::vector<uint8_t> back(shown.begin(), shown.end());
      ASSIGN_OR_RETURN(const auto masks, segmenter_.Segment(query, {&truth.view, 1}));
      sum.selection_iou += Iou(back, truth.MaskOf(entity_.name), truth.ignore) / num_scored;
      sum.selection_against_masks += Iou(back, masks[0].mask.pixels) / num_scored;
    }
    return absl::OkStatus();
  }

  const Segmenter& segmenter_;
  const EvaluationTask& task_;
  const ScoredEntity& entity_;
  const TruthView& reference_;
  const PointPrompt click_;
};

}  // namespace

absl::StatusOr<EntityProposals> ScoreProposals(const Segmenter& segmenter,
                                               const EvaluationTask& task,
                                               const ScoredEntity& entity) {
  return EntityScorer(segmenter, task, entity).Propose();
}

absl::StatusOr<PromptScores> ScorePrompts(const Segmenter& segmenter, const EvaluationTask& task,
                                          std::span<const std::vector<TruthView>> levels) {
  PromptScores sum;
  for (const ScoredEntity& entity : task.entities) {
    const EntityScorer scorer(segmenter, task, entity);
    ASSIGN_OR_RETURN(const EntityProposals proposed, scorer.Propose());
    sum.first_iou += proposed.first_iou;
    sum.best_of_three_iou += proposed.best_of_three_iou;
    sum.best_iou += proposed.best_iou;
    if (!proposed.proposals.empty()) {
      RETURN_IF_ERROR(scorer.AddFirstProposal(proposed.proposals[0], levels, sum));
    }
    RETURN_IF_ERROR(scorer.AddMaskAndBox(sum));
  }
  const auto count = static_cast<double>(task.entities.size());
  for (double* value : {&sum.first_iou, &sum.best_of_three_iou, &sum.best_iou, &sum.choosing_ms,
                        &sum.first_thing_iou, &sum.mask_iou, &sum.box_iou, &sum.selection_iou,
                        &sum.selection_against_masks}) {
    *value /= count;
  }
  return sum;
}

}  // namespace pepeseg
