#include <utility>

#include "absl/strings/str_cat.h"
#include "core/base/status_macros.h"
#include "core/dataset/photo_file.h"
#include "core/dataset/view_warp.h"
#include "core/formats/exif.h"
#include "core/formats/heic.h"
#include "core/formats/heic_header.h"
#include "core/formats/images.h"

namespace pepeseg {
namespace {

// Warps a decoded photograph, whose file has an EXIF orientation, to the view.
absl::StatusOr<Image> WarpToView(const ModelView& view, absl::string_view name, Image image,
                                 int orientation) {
  if (!view.photograph) {
    return absl::InternalError(absl::StrCat(name, ": the view has no photograph"));
  }
  const Lens& lens = view.photograph->lens;
  // The import records the file's orientation, or has turned the photograph upright (import.h).
  if (view.photograph->orientation != orientation) {
    Image upright = Upright(image, orientation);
    if (upright.width == lens.width && upright.height == lens.height) image = std::move(upright);
  }
  if (image.width != lens.width || image.height != lens.height) {
    return absl::InvalidArgumentError(
        absl::StrCat(name, ": ", image.width, "x", image.height, " pixels, the model's view is ",
                     "of a photograph of ", lens.width, "x", lens.height));
  }
  return ViewWarp::Restore(*view.photograph, view.camera).Photo(image);
}

}  // namespace

absl::StatusOr<Image> FormPhotograph(std::span<const uint8_t> bytes, absl::string_view name,
                                     const PhotographForm& form) {
  Image image;
  int orientation = 1;
  if (IsHeic(bytes)) {  // DecodeHeic turns it upright
    ASSIGN_OR_RETURN(HeicPhoto photo, DecodeHeic(bytes, name));
    image = std::move(photo.image);
  } else {
    ASSIGN_OR_RETURN(image, DecodePhoto(bytes, name));
    orientation = ReadExifOrientation(bytes);
  }
  if (form.view) {
    ASSIGN_OR_RETURN(image, WarpToView(*form.view, name, std::move(image), orientation));
  } else if (form.upright) {
    image = Upright(std::move(image), orientation);
  }
  return ShrunkTo(std::move(image), form.max_side);
}

}  // namespace pepeseg
