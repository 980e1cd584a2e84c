#include "core/query/resolve_prompt.h"

#include "core/query/check_prompt.h"
#include "core/status_macros.h"

namespace pepeseg {

absl::StatusOr<Query> ResolvePrompt(const Segmenter& segmenter, const Prompt& prompt,
                                    const Granularity& granularity) {
  const auto* points = std::get_if<std::vector<PointPrompt>>(&prompt.what);
  if (points == nullptr) return absl::UnimplementedError("only points");
  Query query;
  ASSIGN_OR_RETURN(query.features, segmenter.PointFeatures(prompt.view, *points));
  for (const PointPrompt& point : *points) query.positive.push_back(point.positive ? 1 : 0);
  query.scale = granularity.scale.value_or(query.scale);
  query.threshold = granularity.threshold.value_or(query.threshold);
  return query;
}

}  // namespace pepeseg
