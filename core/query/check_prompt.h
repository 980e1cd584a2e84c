#pragma once

#include <span>

#include "absl/status/status.h"
#include "absl/strings/string_view.h"
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

// INVALID_ARGUMENT: the prompt is valid, but the model shows no Gaussian with a feature there, as
// where the background is or where no mask was. IsNothingThere tells it from other refusals.
absl::Status NothingThereError(absl::string_view message);
bool IsNothingThere(const absl::Status& status);

}  // namespace pepeseg
