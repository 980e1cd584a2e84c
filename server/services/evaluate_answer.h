#pragma once

#include <vector>

#include "absl/status/statusor.h"
#include "core/evaluate/one_click.h"
#include "pepeseg/v1/evaluation.pb.h"

namespace pepeseg {

// The labels of an Evaluate request, decoded and taken to the views as the import takes masks.
// INVALID_ARGUMENT names the field.
absl::StatusOr<std::vector<LabeledView>> ReadLabels(const v1::EvaluateRequest& request,
                                                    const Model& model);

// The defaults, overlaid with what is there, and checked.
absl::StatusOr<OneClickOptions> OneClickOptionsFromProto(const v1::EvaluationOptions& proto);
v1::EvaluationOptions ToProto(const OneClickOptions& options);

// Entities with their clicks in the frame of the request, what is left out, and means. Names that
// the request has for other ids are not used.
void FillAnswer(const OneClickScores& scores, const v1::EvaluateRequest& request,
                const Model& model, v1::EvaluateResponse* response);

}  // namespace pepeseg
