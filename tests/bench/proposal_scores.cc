#include "tests/bench/proposal_scores.h"

#include <algorithm>
#include <string>
#include <utility>
#include <vector>

#include "core/evaluate/metrics.h"
#include "core/query/propose_scales.h"
#include "core/query/resolve_prompt.h"
#include "core/status_macros.h"

namespace pepeseg {
namespace {

const LabeledView& Named(std::span<const LabeledView> views, const std::string& name) {
  return *std::ranges::find_if(views,
                               [&](const LabeledView& view) { return view.view.name == name; });
}

// On the reference, and the mean over the scored views.
absl::StatusOr<std::pair<double, double>> ScoreQuery(const Segmenter& segmenter, const Query& query,
                                                     std::span<const LabeledView> views,
                                                     const EntityScore& entity) {
  std::vector<double> ious;
  for (const EntityViewScore& of_view : entity.views) {
    const LabeledView& view = Named(views, of_view.view);
    ASSIGN_OR_RETURN(const auto results, segmenter.Segment(query, {&view.view, 1}));
    ious.push_back(
        Iou(results[0].mask.pixels, view.MaskOf(static_cast<uint16_t>(entity.id)), view.ignore));
  }
  double sum = 0;
  for (size_t i = 1; i < ious.size(); ++i) sum += ious[i];
  return std::pair(ious[0], sum / static_cast<double>(ious.size() - 1));
}

}  // namespace

absl::StatusOr<ProposalScores> ScoreProposals(const Segmenter& segmenter,
                                              std::span<const LabeledView> views,
                                              std::span<const EntityScore> entities) {
  ProposalScores sum;
  for (const EntityScore& entity : entities) {
    if (entity.missing) continue;
    const ModelView& reference = Named(views, entity.views[0].view).view;
    ASSIGN_OR_RETURN(const auto proposals, ProposeScales(segmenter, reference, {&entity.click, 1}));
    std::vector<std::pair<double, double>> scores;
    for (const ScaleProposal& proposal : proposals) {
      ASSIGN_OR_RETURN(const Query query,
                       ResolvePrompt(segmenter, {reference, std::vector<PointPrompt>{entity.click}},
                                     {proposal.result.scale, proposal.result.threshold}));
      ASSIGN_OR_RETURN(scores.emplace_back(), ScoreQuery(segmenter, query, views, entity));
    }
    if (scores.empty()) continue;
    const auto by_reference = [](const auto& a, const auto& b) { return a.first < b.first; };
    sum.first_iou += scores.front().second;
    sum.best_iou += std::ranges::max_element(scores, by_reference)->second;
  }
  const auto count = static_cast<double>(entities.size());
  return ProposalScores{sum.first_iou / count, sum.best_iou / count};
}

}  // namespace pepeseg
