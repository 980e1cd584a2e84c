#pragma once

#include <span>

#include "absl/status/status.h"
#include "core/query/prompt.h"

namespace pepeseg {

// INVALID_ARGUMENT with the field, its value and its limits.
absl::Status CheckView(const ModelView& view);
absl::Status CheckScale(double scale);
absl::Status CheckThreshold(double threshold);
absl::Status CheckPoints(const ModelView& view, std::span<const PointPrompt> points);
absl::Status CheckBox(const ModelView& view, const BoxPrompt& box);
absl::Status CheckMask(const ModelView& view, const BinaryMask& mask);
absl::Status CheckQuery(const Query& query);

}  // namespace pepeseg
