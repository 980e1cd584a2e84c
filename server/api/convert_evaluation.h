#pragma once

#include "absl/status/statusor.h"
#include "core/evaluate/evaluate.h"
#include "pepeseg/v1/evaluation_service.pb.h"

// Conversions of the options and the scores of EvaluateModel.
namespace pepeseg {

// Returns the defaults of core, overlaid with the fields that are present. INVALID_ARGUMENT names
// the field. accept_trained_views belongs to the request (ReadTruthViews).
absl::StatusOr<EvaluationOptions> EvaluationOptionsFromProto(const v1::EvaluationOptions& proto);

// Returns a message in which every field is present.
v1::EvaluationOptions ToProto(const EvaluationOptions& options, bool accept_trained_views);

// Fills in the scores of entities, categories and scene, or the agreement with SAM. Clicks are in
// the pixels of `frame`. Choices that the protocol does not make stay absent.
void FillEvaluation(const EvaluationResult& result, v1::PixelFrame frame, const Model& model,
                    v1::EvaluateModelResponse* response);

}  // namespace pepeseg
