#pragma once

#include <span>

#include "absl/status/status.h"
#include "absl/strings/string_view.h"
#include "core/query/prompt.h"

namespace pepeseg {

// Each returns INVALID_ARGUMENT, which names the field, its value and its limits, unless the
// argument is valid.
absl::Status CheckView(const ModelView& view);
absl::Status CheckScale(double scale);
absl::Status CheckThreshold(double threshold);
absl::Status CheckPoints(const ModelView& view, std::span<const PointPrompt> points);
absl::Status CheckBox(const ModelView& view, const BoxPrompt& box);
absl::Status CheckMask(const ModelView& view, const BinaryMask& mask);
absl::Status CheckQuery(const Query& query);

// Returns INVALID_ARGUMENT for a valid prompt where the model shows no Gaussian with a feature, as
// in the background or where no mask covered anything in training. IsNothingThere distinguishes it
// from other errors by a payload of the status.
absl::Status NothingThereError(absl::string_view message);
bool IsNothingThere(const absl::Status& status);

}  // namespace pepeseg
