#include "core/evaluate/proposal_scores.h"

#include <algorithm>

#include "core/base/status_macros.h"
#include "core/evaluate/scored_entities.h"
#include "core/evaluate/segmentation_metrics.h"
#include "core/prompt/propose_scales.h"
#include "core/prompt/resolve_prompt.h"
#include "core/query/prompt.h"

namespace pepeseg {
namespace {

constexpr size_t kNumLookedAt = 3;  // proposals that the person compares

// Returns the scored IoU of the proposal that is best on the reference, the earlier one among
// equals, or 0 if none overlaps the entity there.
double BestOf(std::span<const ProposalScore> proposals) {
  ProposalScore best;
  for (const ProposalScore& proposal : proposals) {
    if (proposal.reference_iou > best.reference_iou) best = proposal;
  }
  return best.iou;
}

absl::StatusOr<EntityProposals> Score(const Segmenter& segmenter, const ShownEntity& entity) {
  EntityProposals score = {.id = entity.id, .click = FirstClick(entity), .proposals = {}};
  const LabeledView& reference = *entity.views[0];
  auto proposed = ProposeScales(segmenter, reference.view, {&score.click, 1});
  if (IsNothingThere(proposed.status())) return score;
  RETURN_IF_ERROR(proposed.status());
  std::stable_sort(proposed->ladder.begin(), proposed->ladder.end(),
                   [](const auto& a, const auto& b) { return a.support > b.support; });
  const Prompt prompt = {reference.view, std::vector{score.click}};
  for (const ScaleProposal& proposal : proposed->ladder) {
    const SegmentResult& result = proposal.result;
    ASSIGN_OR_RETURN(const Query query,
                     ResolvePrompt(segmenter, prompt, {result.scale, result.threshold}));
    ASSIGN_OR_RETURN(const double iou, MeanScoredIou(segmenter, query, entity));
    score.proposals.push_back(
        {result.scale, result.threshold, proposal.support,
         Iou(result.mask.pixels, reference.MaskOf(entity.id), reference.ignore), iou});
  }
  const std::span<const ProposalScore> all = score.proposals;
  if (!all.empty()) score.first_iou = all[0].iou;
  score.best_of_three_iou = BestOf(all.first(std::min(kNumLookedAt, all.size())));
  score.best_iou = BestOf(all);
  return score;
}

}  // namespace

absl::StatusOr<ProposalScores> EvaluateProposals(
    const Segmenter& segmenter, std::span<const LabeledView> views, int64_t min_pixels,
    absl::FunctionRef<absl::Status()> check_cancelled) {
  ASSIGN_OR_RETURN(const ScoredEntities found, FindScoredEntities(views, min_pixels));
  const auto count = static_cast<double>(found.entities.size());
  ProposalScores scores;
  for (const ShownEntity& entity : found.entities) {
    RETURN_IF_ERROR(check_cancelled());
    ASSIGN_OR_RETURN(EntityProposals score, Score(segmenter, entity));
    scores.first_iou += score.first_iou / count;
    scores.best_of_three_iou += score.best_of_three_iou / count;
    scores.best_iou += score.best_iou / count;
    scores.entities.push_back(std::move(score));
  }
  return scores;
}

}  // namespace pepeseg
