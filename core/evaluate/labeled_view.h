#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "core/scene/model.h"

namespace pepeseg {

// A view with its ground truth. An entity is what is to be segmented: a part, an object, a group.
struct LabeledView {
  ModelView view;
  std::vector<uint16_t> labels;  // [height, width], the entity's id; 0: none
  std::vector<uint8_t> ignore;   // [height, width], non-zero: not scored; or empty

  bool Counts(size_t pixel) const { return ignore.empty() || ignore[pixel] == 0; }
  // 0 or 1 a pixel, without ignored ones.
  std::vector<uint8_t> MaskOf(uint16_t entity) const;
};

// INVALID_ARGUMENT names the view whose labels or ignore mask do not have its size, or that comes
// twice.
absl::Status CheckLabeledViews(std::span<const LabeledView> views);

// An entity and the views that show it, by their names.
struct ShownEntity {
  uint16_t id = 0;
  std::vector<const LabeledView*> views;
  std::vector<int64_t> num_pixels;  // of each, without ignored ones
};

// Every entity of the views, by id, with those views that show at least `min_pixels` of it.
std::vector<ShownEntity> FindEntities(std::span<const LabeledView> views, int64_t min_pixels);

}  // namespace pepeseg
