#pragma once

#include "absl/status/status.h"
#include "pepeseg/v1/segmentation_service.pb.h"
#include "server/rpc/call_runner.h"
#include "server/services/model_loader.h"

namespace pepeseg {

// Answers SegmentationService.CorrectSegment: corrects a model in memory, stores the result as a
// new model of the scene and loads it. Blocks on the store and the disk. The device is used for
// moments only, so that queries are answered meanwhile.
absl::Status AnswerCorrectSegment(const UnaryCall& call, ModelLoader& models,
                                  const v1::CorrectSegmentRequest& request,
                                  v1::CorrectSegmentResponse* response);

}  // namespace pepeseg
