#pragma once

#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "clients/cli/picture.h"
#include "clients/cpp/client.h"
#include "pepeseg/v1/segmentation_service.pb.h"

namespace pepeseg::client::cli {

// A view of a model in the model's colours, in the frame's pixels; shrunk where those are too many
// for an answer.
absl::StatusOr<Picture> RenderView(const Client& client, const std::string& model,
                                   const std::string& view,
                                   v1::PixelFrame frame = v1::PIXEL_FRAME_PHOTOGRAPH);

using Points = google::protobuf::RepeatedPtrField<v1::PointsPrompt::Point>;
// An RLE mask of a view and points in it, in the pixels of the frame.
struct Overlay {
  const v1::SegmentResponse::ViewMask& mask;
  Points points;
  v1::PixelFrame frame;
};
// The rendering of the view with them drawn over it.
absl::StatusOr<Picture> DrawnOver(const Client& client, const std::string& model,
                                  const Overlay& overlay);

// "frame-000000.jpg" -> "frame-000000"; folders become dashes: a file name for what is about a
// view.
std::string Stem(const std::string& view);

}  // namespace pepeseg::client::cli
