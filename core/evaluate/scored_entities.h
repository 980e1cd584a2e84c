#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "absl/status/statusor.h"
#include "core/evaluate/labeled_view.h"
#include "core/query/segmenter.h"

// What the protocols of this folder share: the entities that they ask for and where they click.

namespace pepeseg {

inline constexpr size_t kMinViews = 2;
inline constexpr size_t kMaxEntities = 1000;

struct ScoredEntities {
  // By id; each with at least kMinViews views. The first view by name is the entity's reference, on
  // which it is clicked; the others are its scored views.
  std::vector<ShownEntity> entities;
  std::vector<int> left_out;  // ids of entities that fewer views show
};

// Returns the entities that at least kMinViews views show `min_pixels` of. They point into `views`.
// INVALID_ARGUMENT: CheckLabeledViews, no entity counts, more than kMaxEntities do.
absl::StatusOr<ScoredEntities> FindScoredEntities(std::span<const LabeledView> views,
                                                  int64_t min_pixels);

// A positive click on the pixel of the reference that is deepest inside the entity.
PointPrompt FirstClick(const ShownEntity& entity);

// IoU of a query's answer with the entity in one of its views, and the mean over its scored views.
absl::StatusOr<double> IouInView(const Segmenter& segmenter, const Query& query,
                                 const LabeledView& view, uint16_t entity);
absl::StatusOr<double> MeanScoredIou(const Segmenter& segmenter, const Query& query,
                                     const ShownEntity& entity);

}  // namespace pepeseg
