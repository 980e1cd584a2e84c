#include "core/query/resolve_prompt.h"

#include <algorithm>
#include <cstdint>
#include <utility>

#include "core/base/status_macros.h"
#include "core/query/click_follower.h"
#include "kernels/ops/render.h"

namespace pepeseg {
namespace {

absl::StatusOr<Query> ResolvePoints(const Segmenter& segmenter, const ModelView& view,
                                    const PointsPrompt& points,
                                    const std::optional<BinaryMask>& previous,
                                    const Granularity& granularity) {
  if (granularity.scale && granularity.threshold) {
    Query query = {{}, {}, *granularity.scale, *granularity.threshold};
    ASSIGN_OR_RETURN(query.features, segmenter.PointFeatures(view, points));
    for (const PointPrompt& point : points) query.positive.push_back(point.positive ? 1 : 0);
    return query;
  }
  ClickFollower follower(segmenter, nullptr, view, granularity);
  RETURN_IF_ERROR(follower.Follow(points, previous, [] { return absl::OkStatus(); }));
  return follower.whole();
}

// Returns the points that are on something with a feature.
absl::StatusOr<PointsPrompt> PointsOnSomething(const Segmenter& segmenter, const ModelView& view,
                                               const PointsPrompt& points) {
  std::vector<size_t> found;
  RETURN_IF_ERROR(
      SolidFeatures(segmenter, view, PixelsOf(points, view.camera.width), &found).status());
  PointsPrompt kept;
  kept.reserve(found.size());
  for (const size_t i : found) kept.push_back(points[i]);
  if (std::any_of(kept.begin(), kept.end(), [](const PointPrompt& p) { return p.positive; })) {
    return kept;
  }
  return NothingThereError("nothing with a feature is rendered under the positive points");
}

absl::StatusOr<Query> ResolveMean(const Segmenter& segmenter, const ModelView& view,
                                  const PointMean& mean, const Granularity& granularity) {
  ASSIGN_OR_RETURN(const PointsPrompt points, PointsOnSomething(segmenter, view, mean.points));
  ASSIGN_OR_RETURN(const std::vector<float> features,
                   SolidFeatures(segmenter, view, PixelsOf(points, view.camera.width)));
  ASSIGN_OR_RETURN(const Query query, ResolvePoints(segmenter, view, points, {}, granularity));
  return MeanQuery(segmenter, features, query.scale, query.threshold);
}

}  // namespace

absl::StatusOr<Query> ResolvePrompt(const Segmenter& segmenter, const Prompt& prompt,
                                    const Granularity& granularity) {
  RETURN_IF_ERROR(CheckGranularity(granularity));
  const ModelView& view = prompt.view;
  return std::visit(
      Overloaded{
          [&](const PointsPrompt& points) {
            return ResolvePoints(segmenter, view, points, prompt.previous, granularity);
          },
          [&](const BoxPrompt& box) { return FitBox(segmenter, view, box, granularity); },
          [&](const BinaryMask& mask) { return FitMask(segmenter, view, mask, granularity); },
          [&](const Scribbles& scribbles) {
            return FitScribbles(segmenter, view, scribbles, granularity);
          },
          [&](const PointMean& mean) { return ResolveMean(segmenter, view, mean, granularity); }},
      prompt.what);
}

}  // namespace pepeseg
