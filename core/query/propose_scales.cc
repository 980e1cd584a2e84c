#include "core/query/propose_scales.h"

#include <algorithm>
#include <cstdint>
#include <utility>

#include "absl/strings/str_cat.h"
#include "core/base/status_macros.h"
#include "core/query/mask_grid.h"
#include "core/query/resolve_prompt.h"

namespace pepeseg {
namespace {

// Returns whether `large` may stand above `small`, by their masks in the view itself. The ladder
// was found in a smaller view, in which masks may nest that do not nest here.
bool Holds(const SegmentResult& large, const SegmentResult& small) {
  int64_t common = 0;
  for (size_t p = 0; p < small.mask.pixels.size(); ++p) {
    common += small.mask.pixels[p] != 0 && large.mask.pixels[p] != 0 ? 1 : 0;
  }
  return static_cast<double>(large.area) >= Ladder::kMinGrowth * static_cast<double>(small.area) &&
         static_cast<double>(common) >= Ladder::kMinHeld * static_cast<double>(small.area);
}

// Removes proposals that do not nest with their neighbour on the side of the best one.
void KeepNested(ScaleProposals& proposals) {
  std::vector<ScaleProposal>& ladder = proposals.ladder;
  for (int i = proposals.best - 1; i >= 0; --i) {
    if (Holds(ladder[i + 1].result, ladder[i].result)) continue;
    ladder.erase(ladder.begin() + i);
    --proposals.best;
  }
  for (size_t i = proposals.best + 1; i < ladder.size();) {
    if (Holds(ladder[i].result, ladder[i - 1].result)) {
      ++i;
    } else {
      ladder.erase(ladder.begin() + static_cast<ptrdiff_t>(i));
    }
  }
}

}  // namespace

absl::StatusOr<ScaleProposals> ProposeScales(const Segmenter& segmenter, const ModelView& view,
                                             std::span<const PointPrompt> points,
                                             const ProposeOptions& options) {
  if (options.max_count < 1) {
    return absl::InvalidArgumentError(
        absl::StrCat(options.max_count, " proposals are asked for, must be at least 1"));
  }
  ASSIGN_OR_RETURN(const ClickedFeatures clicks, FindClickedFeatures(segmenter, view, points));
  ASSIGN_OR_RETURN(const GranularityLadder found,
                   FindGranularities(segmenter, clicks, GridOf({}), options.max_count));
  ScaleProposals proposals = {{}, found.best};
  Query query = clicks.query;
  for (const StableGranularity& at : found.rungs) {
    query.scale = at.scale;
    query.threshold = at.threshold;
    ASSIGN_OR_RETURN(std::vector<SegmentResult> results,
                     segmenter.Segment(query, {&view, 1}, options.segment));
    proposals.ladder.push_back({std::move(results[0]), at.stability, at.support});
  }
  KeepNested(proposals);
  const auto count = static_cast<int>(proposals.ladder.size());
  const std::vector<ProposalKind> kinds = KindsOfLadder(count, proposals.best);
  for (int i = 0; i < count; ++i) proposals.ladder[i].kind = kinds[i];
  return proposals;
}

std::vector<ProposalKind> KindsOfLadder(int count, int best) {
  std::vector<ProposalKind> kinds(count, ProposalKind::kUnnamed);
  if (count < 2) return kinds;
  const int object = count == 2 ? best : std::clamp(best, 1, count - 2);
  for (int i = 0; i < count; ++i) {
    kinds[i] = i < object    ? ProposalKind::kPart
               : i == object ? ProposalKind::kObject
                             : ProposalKind::kGroup;
  }
  return kinds;
}

}  // namespace pepeseg
