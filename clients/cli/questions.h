#pragma once

#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "clients/cli/picture.h"
#include "clients/cpp/client.h"
#include "pepeseg/v1/segmentation_service.pb.h"

namespace pepeseg::client::cli {

// A view of a model in the model's colours.
absl::StatusOr<Picture> RenderView(const Client& client, const std::string& model,
                                   const std::string& view);

using Points = google::protobuf::RepeatedPtrField<v1::PointsPrompt::Point>;
// The rendering of a view with an RLE mask and points drawn over it.
absl::StatusOr<Picture> OverlayOf(const Client& client, const std::string& model,
                                  const v1::SegmentResponse::ViewMask& view, const Points& points);

// "frame-000000.jpg" -> "frame-000000"; folders become dashes: a file name for what is about a
// view.
std::string Stem(const std::string& view);

}  // namespace pepeseg::client::cli
