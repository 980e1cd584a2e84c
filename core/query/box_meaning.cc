#include "core/query/box_meaning.h"

#include <algorithm>
#include <utility>

#include "core/base/status_macros.h"
#include "core/query/mask_geometry.h"
#include "core/query/resolve_prompt.h"

namespace pepeseg {
namespace {

// Returns the IoU of a box in an image and the bounding box of a mask.
double Agreement(const BoxPrompt& box, std::span<const uint8_t> mask, const Camera& image) {
  int found[4];
  FindBox(mask, image.width, found);
  const auto [x, y, width, height] = found;
  return IouOf(EdgesIn(box, image.width, image.height),
               {double(x), double(y), double(x + width), double(y + height)});
}

}  // namespace

absl::StatusOr<PromptMeaning> FindInBox(const Segmenter& model, ImageSegmenter& images,
                                        const ModelView& view, const BoxPrompt& box,
                                        const WantedCheck& check) {
  RETURN_IF_ERROR(CheckBox(ImageOf(view), box));
  PromptMeaning meaning;
  ASSIGN_OR_RETURN(ImageMasks seen, images.Box(view, box, check));
  double most = 0;
  for (SoftMask& mask : seen.masks) {
    const double value = mask.iou * Agreement(box, mask.mask.pixels, view.camera);
    if (value <= most) continue;
    most = value;
    meaning.mask = std::move(mask.mask);
    meaning.image = seen.image;
  }
  if (most > 0) return meaning;
  ASSIGN_OR_RETURN(meaning.query, FitBox(model, view, box, {}));
  meaning.is_of_query = true;
  return meaning;
}

}  // namespace pepeseg
