#pragma once

#include <vector>

#include "pepeseg/v1/scene_service.pb.h"
#include "pepeseg/v1/segmentation_service.pb.h"

// Requests that SAM answers. SAM takes one to two seconds for a new view, the server takes at
// most 100 views per request, and a call has a deadline: many views are requested a few at a time.
namespace pepeseg::client {

// Returns requests for the target views of `request`, each view once, at most 8 views per request.
// A request of at most 8 views, or of the prompt's view, is returned as it is. `views`: those of
// the model, in its order; read only if the targets are a group.
std::vector<v1::SegmentViewsRequest> PiecesOf(const v1::SegmentViewsRequest& request,
                                              const std::vector<v1::View>& views);

// Adds the masks, the times and the agreement with a box of `piece` to `whole`.
void AddPiece(const v1::SegmentViewsResponse& piece, v1::SegmentViewsResponse& whole);

}  // namespace pepeseg::client
