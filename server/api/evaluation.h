#pragma once

#include <vector>

#include "absl/status/statusor.h"
#include "core/evaluate/one_click.h"
#include "pepeseg/v1/evaluation_service.pb.h"

// Conversions of EvaluateModel requests and answers.
namespace pepeseg {

// Decodes the labels of a request and takes them to the views, in the way the import takes masks.
// INVALID_ARGUMENT names the field.
absl::StatusOr<std::vector<LabeledView>> ReadLabels(const v1::EvaluateModelRequest& request,
                                                    const Model& model);

// Returns the defaults, overlaid with the fields that are present. INVALID_ARGUMENT names the
// field.
absl::StatusOr<OneClickOptions> OneClickOptionsFromProto(const v1::EvaluationOptions& proto);
v1::EvaluationOptions ToProto(const OneClickOptions& options);

// Fills in entities with their clicks in the frame of the request, the ids that were left out, and
// means. Names in the request for ids that no label has are ignored.
void FillAnswer(const OneClickScores& scores, const v1::EvaluateModelRequest& request,
                const Model& model, v1::EvaluateModelResponse* response);

}  // namespace pepeseg
