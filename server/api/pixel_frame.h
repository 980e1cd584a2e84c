#pragma once

#include <optional>
#include <string>

#include "absl/status/status.h"
#include "core/query/photograph_frame.h"
#include "core/query/segmenter.h"
#include "core/query/view_places.h"
#include "core/scene/model.h"
#include "pepeseg/v1/prompt.pb.h"

// The image whose pixels a request and its answer are in.
namespace pepeseg {

// INVALID_ARGUMENT: not a value of PixelFrame.
absl::Status CheckFrame(v1::PixelFrame frame);

struct ImageOfView {
  PhotographFrame frame;  // for PIXEL_FRAME_VIEW its photograph is the view itself
  std::string name;       // for messages: photograph "a.jpg", view "a.jpg", or the free camera

  // "640x480".
  std::string Size() const;
};
ImageOfView ImageOf(const ModelView& view, v1::PixelFrame frame);

// Takes results from the views that were segmented to the frame of a request. Views of one camera
// mostly follow each other: what the last one needed is kept. Not thread safe.
class AnswerFrame {
 public:
  explicit AnswerFrame(v1::PixelFrame frame) : frame_(frame) {}

  // `result`, of `view`, in the pixels of the frame.
  SegmentResult Take(const ModelView& view, SegmentResult result);

 private:
  v1::PixelFrame frame_;
  std::optional<ViewPlaces> places_;
};

}  // namespace pepeseg
