#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "absl/status/statusor.h"
#include "core/evaluate/labeled_view.h"
#include "core/query/segmenter.h"

// Shared by the protocols of this folder: which entities they score, and where they click first.

namespace pepeseg {

inline constexpr size_t kMinViews = 2;
inline constexpr size_t kMaxEntities = 1000;

struct ScoredEntities {
  // Sorted by id, each with at least kMinViews views. The first view by name is the reference,
  // which is clicked on; the others are the scored views.
  std::vector<ShownEntity> entities;
  std::vector<int> left_out;  // ids of entities that fewer views show
};

// Returns the entities of which at least kMinViews views show `min_pixels` pixels. The result
// points into `views`. Returns INVALID_ARGUMENT for the reasons of CheckLabeledViews, and if there
// is no such entity or more than kMaxEntities.
absl::StatusOr<ScoredEntities> FindScoredEntities(std::span<const LabeledView> views,
                                                  int64_t min_pixels);

// Returns a positive click on the pixel of the reference that is deepest inside the entity.
PointPrompt FirstClick(const ShownEntity& entity);

// Returns the IoU of a query's mask and the entity in one view, or the mean over its scored views.
absl::StatusOr<double> IouInView(const Segmenter& segmenter, const Query& query,
                                 const LabeledView& view, uint16_t entity);
absl::StatusOr<double> MeanScoredIou(const Segmenter& segmenter, const Query& query,
                                     const ShownEntity& entity);

}  // namespace pepeseg
