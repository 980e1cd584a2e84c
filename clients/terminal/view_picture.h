#pragma once

#include <filesystem>
#include <string>

#include "absl/status/statusor.h"
#include "clients/cpp/client.h"
#include "clients/terminal/picture.h"
#include "pepeseg/v1/prompt.pb.h"
#include "pepeseg/v1/scene_service.pb.h"
#include "pepeseg/v1/segmentation_service.pb.h"

// Pictures of the views of a model.
namespace pepeseg::client::cli {

// Returns the size of the uploaded photograph, or of the view if the server does not know that.
PixelSize PhotographSize(const v1::View& view);

// Renders a view of a model in colour, in the pixels of `frame`; smaller if the server limits the
// size of its answer.
absl::StatusOr<Picture> RenderView(const Client& client, const std::string& model,
                                   const std::string& view,
                                   v1::PixelFrame frame = v1::PIXEL_FRAME_PHOTOGRAPH);

using Points = google::protobuf::RepeatedPtrField<v1::PointsPrompt::Point>;
// The overlay that is drawn on a view.
struct Overlay {
  const v1::SegmentViewsResponse::ViewMask& mask;  // RLE; names the view
  Points points;                                   // pixels of `frame`
  v1::PixelFrame frame;
};
// Renders the view of the overlay's mask with the mask tinted and outlined, by the server, and
// draws the points over it.
absl::StatusOr<Picture> DrawnOver(const Client& client, const std::string& model,
                                  const Overlay& overlay);

// Writes that picture. The server's file is kept as it is where there are no points to draw.
absl::Status WriteDrawnOver(const std::filesystem::path& path, const Client& client,
                            const std::string& model, const Overlay& overlay);

// Writes a mask as an 8-bit grey PNG, 0 and 255. DATA_LOSS: the run lengths are malformed.
absl::Status WriteMask(const std::filesystem::path& path, const v1::CocoRle& rle);

// Returns a file name without extension for what belongs to a view: "frame-000000" for
// "frame-000000.jpg"; '/' becomes '-'.
std::string Stem(const std::string& view);

}  // namespace pepeseg::client::cli
