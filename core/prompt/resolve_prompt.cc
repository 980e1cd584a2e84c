#include "core/prompt/resolve_prompt.h"

#include "core/base/status_macros.h"
#include "core/prompt/click_granularity.h"
#include "core/prompt/fit_prompt.h"
#include "core/query/check_prompt.h"

namespace pepeseg {
namespace {

absl::StatusOr<Query> ResolvePoints(const Segmenter& segmenter, const ModelView& view,
                                    const std::vector<PointPrompt>& points,
                                    const Granularity& granularity) {
  ASSIGN_OR_RETURN(ClickedFeatures clicks, FindClickedFeatures(segmenter, view, points));
  Query& query = clicks.query;
  query.scale = granularity.scale.value_or(query.scale);
  query.threshold = granularity.threshold.value_or(query.threshold);
  if (granularity.scale && granularity.threshold) return query;
  ASSIGN_OR_RETURN(const GranularityLadder ladder,
                   FindGranularities(segmenter, clicks, GridOf(granularity), 1));
  if (ladder.rungs.empty())
    return query;  // masks of under 16 pixels at any scale: keep the defaults
  const StableGranularity& best = ladder.rungs[ladder.best];
  query.scale = best.scale;
  query.threshold = granularity.threshold.value_or(best.threshold);
  return query;
}

}  // namespace

absl::StatusOr<Query> ResolvePrompt(const Segmenter& segmenter, const Prompt& prompt,
                                    const Granularity& granularity) {
  if (granularity.scale) RETURN_IF_ERROR(CheckScale(*granularity.scale));
  if (granularity.threshold) RETURN_IF_ERROR(CheckThreshold(*granularity.threshold));
  if (const auto* mask = std::get_if<BinaryMask>(&prompt.what)) {
    return FitMask(segmenter, prompt.view, *mask, granularity);
  }
  if (const auto* box = std::get_if<BoxPrompt>(&prompt.what)) {
    return FitBox(segmenter, prompt.view, *box, granularity);
  }
  return ResolvePoints(segmenter, prompt.view, std::get<0>(prompt.what), granularity);
}

}  // namespace pepeseg
