#include "core/query/propose_scales.h"

#include <utility>

#include "absl/strings/str_cat.h"
#include "core/query/choose_granularity.h"
#include "core/status_macros.h"

namespace pepeseg {

absl::StatusOr<std::vector<ScaleProposal>> ProposeScales(const Segmenter& segmenter,
                                                         const ModelView& view,
                                                         std::span<const PointPrompt> points,
                                                         int max_count) {
  if (max_count < 1) {
    return absl::InvalidArgumentError(
        absl::StrCat(max_count, " proposals are asked for, must be at least 1"));
  }
  Query query;
  ASSIGN_OR_RETURN(query.features, segmenter.PointFeatures(view, points));
  for (const PointPrompt& point : points) query.positive.push_back(point.positive ? 1 : 0);
  ASSIGN_OR_RETURN(const std::vector<StableGranularity> stable,
                   FindStable(segmenter, query, view, GridOf({}), max_count));
  std::vector<ScaleProposal> proposals;
  for (const StableGranularity& at : stable) {
    query.scale = at.scale;
    query.threshold = at.threshold;
    ASSIGN_OR_RETURN(std::vector<SegmentResult> results, segmenter.Segment(query, {&view, 1}));
    proposals.push_back({std::move(results[0]), at.stability, at.support});
  }
  return proposals;
}

}  // namespace pepeseg
