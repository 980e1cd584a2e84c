#pragma once

#include "absl/status/status.h"
#include "core/query/segmenter.h"

namespace pepeseg {

// INVALID_ARGUMENT with the field, its value and its limits.
absl::Status CheckView(const ModelView& view);
absl::Status CheckScale(double scale);
absl::Status CheckPrompt(const Segmenter::Prompt& prompt);

}  // namespace pepeseg
