#pragma once

#include <span>
#include <vector>

#include "absl/status/statusor.h"
#include "core/evaluate/evaluate.h"
#include "pepeseg/v1/evaluation_service.pb.h"
#include "server/api/segment_request.h"
#include "server/api/truth_frames.h"

namespace pepeseg {

// Reads the prompts of an EvaluateModel request in the pixels of their views, which must be among
// `views`. A label is read as its mask. INVALID_ARGUMENT names the field: a prompt is malformed or
// does not fit its view, an entity is unknown or has two prompts. NOT_FOUND: no such label.
// `frames`: the pixels that their masks are of. FAILED_PRECONDITION: the model does not have the
// view of the label. Blocks on the store.
absl::StatusOr<std::vector<EntityPrompt>> ReadEntityPrompts(const v1::EvaluateModelRequest& request,
                                                            std::span<const TruthView> views,
                                                            const SegmentRequestReader& reader,
                                                            const TruthFrames& frames);

}  // namespace pepeseg
