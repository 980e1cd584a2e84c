#pragma once

#include "core/evaluate/evaluate.h"
#include "core/scene/model.h"
#include "pepeseg/v1/evaluation_service.pb.h"

namespace pepeseg {

// Fills in the scores of entities, categories and scene, or the agreement with SAM. Clicks are in
// the pixels of `frame`. Choices that the protocol does not make stay absent.
void FillEvaluation(const EvaluationResult& result, v1::PixelFrame frame, const Model& model,
                    v1::EvaluateModelResponse* response);

}  // namespace pepeseg
