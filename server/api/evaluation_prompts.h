#pragma once

#include <span>
#include <vector>

#include "absl/status/statusor.h"
#include "core/evaluate/evaluate.h"
#include "pepeseg/v1/evaluation_service.pb.h"
#include "server/api/segment_request.h"
#include "server/api/truth_frames.h"

namespace pepeseg {

// Reads the prompts and own_masks of an EvaluateModel request in the pixels of their views, which
// must be among `views`. `frames`: the pixels that their masks are of. Errors are those of
// SegmentRequestReader::ReadPrompt, which name the field, and INVALID_ARGUMENT: an entity is
// unknown or has two prompts. Blocks on the store.
absl::StatusOr<std::vector<EntityPrompt>> ReadEntityPrompts(const v1::EvaluateModelRequest& request,
                                                            std::span<const TruthView> views,
                                                            const SegmentRequestReader& reader,
                                                            const TruthFrames& frames);

}  // namespace pepeseg
