#pragma once

#include "absl/status/status.h"
#include "clients/cpp/client.h"
#include "pepeseg/v1/segmentation_service.pb.h"

namespace pepeseg::client::cli {

// Replaces the mask in the label's own view by the mask that was accepted, if the request is of a
// label without granularity and `answer` has that view.
absl::Status TakeAcceptedMask(const Client& client, const v1::SegmentViewsRequest& request,
                              v1::SegmentViewsResponse& answer);

}  // namespace pepeseg::client::cli
