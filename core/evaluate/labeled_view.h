#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "core/scene/model.h"

namespace pepeseg {

// A view with its ground truth. An entity is what is to be segmented: a part, an object or a group.
struct LabeledView {
  ModelView view;
  std::vector<uint16_t> labels;  // [height, width] entity ids; 0: no entity
  std::vector<uint8_t> ignore;   // [height, width], non-zero: not scored; empty: all are scored

  // Returns whether a pixel, y * width + x, is scored.
  bool Counts(size_t pixel) const { return ignore.empty() || ignore[pixel] == 0; }
  // Returns the mask of an entity, [height, width] of 0 and 1; ignored pixels are 0.
  std::vector<uint8_t> MaskOf(uint16_t entity) const;
};

// Returns INVALID_ARGUMENT, which names the view, if labels or ignore mask do not have the size of
// their view, or if two views have the same name.
absl::Status CheckLabeledViews(std::span<const LabeledView> views);

// An entity and the views that show it, sorted by name.
struct ShownEntity {
  uint16_t id = 0;
  std::vector<const LabeledView*> views;
  std::vector<int64_t> num_pixels;  // pixels of the entity in each view, without ignored ones
};

// Returns every entity of the views, sorted by id, with those views that show at least `min_pixels`
// of it. An entity that no view shows well enough is returned without views. The result points into
// `views`.
std::vector<ShownEntity> FindEntities(std::span<const LabeledView> views, int64_t min_pixels);

}  // namespace pepeseg
