#pragma once

#include "absl/status/statusor.h"
#include "core/query/prompt.h"
#include "core/query/segmenter.h"

namespace pepeseg {

// Returns the query that a prompt stands for. Chooses scale and threshold where `granularity` has
// none (METHOD.md section 4): for points as FindGranularities does, for a box and a mask by the
// best fit in the prompt's view. Returns INVALID_ARGUMENT if the prompt or the granularity is out
// of the limits of Prompt and Granularity, and NothingThereError if no feature is rendered under
// the prompt.
absl::StatusOr<Query> ResolvePrompt(const Segmenter& segmenter, const Prompt& prompt,
                                    const Granularity& granularity);

}  // namespace pepeseg
