#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/strings/string_view.h"
#include "core/scene/mask_set.h"
#include "core/scene/model.h"

namespace pepeseg {

// A view with the masks of the entities that it shows, which may overlap. An entity is what is to
// be segmented: a part, an object or a group. It has the same name in all views.
struct TruthView {
  ModelView view;
  MaskSet masks;
  std::vector<std::string> entities;  // [masks.num_masks] names, each once
  std::vector<uint8_t> ignore;  // [height, width], non-zero: not scored; empty: all are scored
  int64_t num_void = 0;         // pixels that the label image marks as void; `ignore` has them, too

  // Returns the index of an entity's mask, or nothing if the view does not show the entity.
  std::optional<int> IndexOf(absl::string_view entity) const;
  // Returns the mask of an entity, [height, width] of 0 and 1, or an empty vector if the view does
  // not show it. Ignored pixels are as they were given.
  std::vector<uint8_t> MaskOf(absl::string_view entity) const;
  // Returns MaskOf with 0 in ignored pixels: what may be clicked and counted.
  std::vector<uint8_t> CountedMaskOf(absl::string_view entity) const;
};

// The labels that mark void pixels in label images: of PASCAL VOC, DAVIS and others, and that of
// images of 16 bits.
inline constexpr int kVoidLabel = 255, kWideVoidLabel = 65535;

// Returns the label of void pixels in a label image: kVoidLabel or kWideVoidLabel if it is the
// largest label and there is another one besides 0; for kWideVoidLabel, none of the upper half of
// its range. Returns nothing otherwise, where these labels are entities: an image of 0 and 255 is a
// binary mask, and an image with larger labels counts past 255.
std::optional<int> VoidLabelOf(std::span<const uint16_t> labels);

// Collects the truth of a view from label images, binary masks, or both. Each function returns
// INVALID_ARGUMENT, which names the view and the entity, if an image does not have the size of the
// view or an entity has a mask already.
class TruthViewBuilder {
 public:
  explicit TruthViewBuilder(ModelView view);

  // Adds the mask of an entity: [height, width], non-zero inside. The name must not be empty. An
  // empty mask adds nothing: the view does not show the entity.
  absl::Status AddMask(const std::string& entity, std::span<const uint8_t> mask);
  // Adds the mask of each id of a label image [height, width]; 0 is no entity. An id without a name
  // in `names` is its own name: "3". Pixels with the label `void_label` are in no entity and are
  // ignored.
  absl::Status AddLabels(std::span<const uint16_t> labels, const std::map<int, std::string>& names,
                         std::optional<int> void_label = std::nullopt);
  // Adds ignored pixels: [height, width], non-zero: not scored.
  absl::Status AddIgnore(std::span<const uint8_t> ignore);
  // Returns the size of the masks' bitsets in bytes, so that callers can limit what a request may
  // take.
  int64_t BitsetBytes() const { return masks_.BitsetBytes(); }

  TruthView Build() &&;

 private:
  absl::Status CheckSize(absl::string_view what, size_t num_pixels) const;
  absl::Status Add(const std::string& entity, std::span<const uint32_t> pixels);

  TruthView truth_;
  MaskSetBuilder masks_;
};

// Returns an entity's name without its number: "mug" for "mug.2", "mug 2", "mug_2" and "mug-2".
// Other names are their own category.
std::string CategoryOf(absl::string_view entity);

}  // namespace pepeseg
