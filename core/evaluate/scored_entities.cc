#include "core/evaluate/scored_entities.h"

#include <utility>

#include "absl/strings/str_cat.h"
#include "core/base/status_macros.h"
#include "core/evaluate/segmentation_metrics.h"
#include "core/query/mask_geometry.h"

namespace pepeseg {

absl::StatusOr<ScoredEntities> FindScoredEntities(std::span<const LabeledView> views,
                                                  int64_t min_pixels) {
  RETURN_IF_ERROR(CheckLabeledViews(views));
  ScoredEntities found;
  for (ShownEntity& entity : FindEntities(views, min_pixels)) {
    if (entity.views.size() < kMinViews) {
      found.left_out.push_back(entity.id);
    } else {
      found.entities.push_back(std::move(entity));
    }
  }
  if (found.entities.empty()) {
    return absl::InvalidArgumentError(absl::StrCat("no entity shows at least ", min_pixels,
                                                   " pixels in at least ", kMinViews, " of the ",
                                                   views.size(), " labelled views"));
  }
  if (found.entities.size() <= kMaxEntities) return found;
  return absl::InvalidArgumentError(absl::StrCat("the labels have ", found.entities.size(),
                                                 " entities, must be at most ", kMaxEntities));
}

PointPrompt FirstClick(const ShownEntity& entity) {
  const LabeledView& reference = *entity.views[0];
  const Camera& camera = reference.view.camera;
  const PixelIndex pixel = DeepestPixel(reference.MaskOf(entity.id), camera.width, camera.height);
  return {pixel.x + 0.5, pixel.y + 0.5, true};
}

absl::StatusOr<double> IouInView(const Segmenter& segmenter, const Query& query,
                                 const LabeledView& view, uint16_t entity) {
  ASSIGN_OR_RETURN(const auto results, segmenter.Segment(query, {&view.view, 1}));
  return Iou(results[0].mask.pixels, view.MaskOf(entity), view.ignore);
}

absl::StatusOr<double> MeanScoredIou(const Segmenter& segmenter, const Query& query,
                                     const ShownEntity& entity) {
  double sum = 0;
  for (size_t v = 1; v < entity.views.size(); ++v) {
    ASSIGN_OR_RETURN(const double iou, IouInView(segmenter, query, *entity.views[v], entity.id));
    sum += iou;
  }
  return sum / static_cast<double>(entity.views.size() - 1);
}

}  // namespace pepeseg
