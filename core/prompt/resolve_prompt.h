#pragma once

#include "absl/status/statusor.h"
#include "core/query/prompt.h"
#include "core/query/segmenter.h"

namespace pepeseg {

// What a prompt asks for, in features, with a scale and a threshold chosen where `granularity` has
// none (METHOD.md section 4): for points the proposal with the most support, for a box and a mask
// those that fit it best in its view. INVALID_ARGUMENT: see Prompt and Granularity; nothing with a
// feature is rendered under the prompt.
absl::StatusOr<Query> ResolvePrompt(const Segmenter& segmenter, const Prompt& prompt,
                                    const Granularity& granularity);

}  // namespace pepeseg
