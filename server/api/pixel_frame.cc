#include "server/api/pixel_frame.h"

#include <utility>

#include "absl/strings/str_cat.h"
#include "core/query/photograph_images.h"
#include "server/api/error.h"

namespace pepeseg {

absl::Status CheckFrame(v1::PixelFrame frame) {
  if (v1::PixelFrame_IsValid(frame)) return absl::OkStatus();
  return BadField("frame", absl::StrCat(static_cast<int>(frame)), "not a frame of pixels");
}

std::string ImageOfView::Size() const { return absl::StrCat(frame.width(), "x", frame.height()); }

ImageOfView ImageOf(const ModelView& view, v1::PixelFrame frame) {
  if (view.name.empty()) return {PhotographFrame(view), "the free camera"};
  if (frame != v1::PIXEL_FRAME_VIEW) {
    return {PhotographFrame(view), absl::StrCat("photograph \"", view.name, "\"")};
  }
  ModelView alone = view;
  alone.photograph.reset();
  return {PhotographFrame(alone), absl::StrCat("view \"", view.name, "\"")};
}

SegmentResult AnswerFrame::Take(const ModelView& view, SegmentResult result) {
  const PhotographFrame frame = ImageOf(view, frame_).frame;
  if (frame.is_view()) return result;
  if (!places_ || places_->frame() != frame) places_.emplace(frame, frame.width(), frame.height());
  return InPhotograph(result, *places_);
}

}  // namespace pepeseg
