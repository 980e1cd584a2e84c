#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"
#include "core/annotations/mask_polygons.h"
#include "core/scene/mask_set.h"

// Things that labels name, and their masks in the views of a model.
namespace pepeseg {

// A label: a name for a thing.
struct LabelText {
  std::string id, text;  // empty text: the id
};

// A labelled thing. It has one category, instance and track in all views.
struct AnnotatedThing {
  std::string id;        // of the label
  std::string text;      // of the label
  std::string category;  // text without its number: "mug" of "mug.2"
  int64_t instance = 0;  // number of the thing in its category: 2 of "mug.2"
  int64_t track = 0;     // number of the thing in the scene, from 1
};

// Returns the labels as things, in their order. A text NAME.NUMBER with a number > 0 that no
// earlier label of the category has gives category and instance; other labels get the lowest free
// numbers of their category.
std::vector<AnnotatedThing> ThingsOf(std::span<const LabelText> labels);

// Returns the categories in the order in which the things have them.
std::vector<std::string> CategoriesOf(std::span<const AnnotatedThing> things);

// What is annotated: things in views, which are photographs.
struct AnnotatedScene {
  std::string name;
  std::vector<AnnotatedThing> things;
  std::vector<std::string> views;  // names
  // The things are segments of one level: their masks do not overlap, and most views show few of
  // many.
  bool are_segments = false;
};

// The masks of a view.
struct AnnotatedView {
  size_t index = 0;                 // of the view in AnnotatedScene
  RasterSize size;                  // of the photograph
  std::vector<std::string> counts;  // COCO's compressed run lengths, one for each thing
};

// Returns the mask of run lengths. INVALID_ARGUMENT: they are malformed, or do not fill it.
absl::StatusOr<BinaryMask> MaskOfCounts(absl::string_view counts, const RasterSize& size);

// Returns whether run lengths are those of an empty mask.
bool ShowNothing(absl::string_view counts, const RasterSize& size);

// Returns the number of pixels of a mask, 0 or 1 each, and the smallest box around them.
struct MaskExtent {
  int64_t area = 0;
  int x = 0, y = 0, width = 0, height = 0;
};
MaskExtent ExtentOf(const BinaryMask& mask, const RasterSize& size);

}  // namespace pepeseg
