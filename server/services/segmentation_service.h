#pragma once

#include "absl/status/status.h"
#include "pepeseg/v1/segmentation_service.grpc.pb.h"
#include "server/rpc/call_runner.h"
#include "server/services/find_answer.h"
#include "server/services/job_snapshots.h"
#include "server/services/model_loader.h"
#include "server/services/segment_answer.h"
#include "server/services/view_images.h"

namespace pepeseg {

// Segments models in memory. Each call is answered on a thread of the pool for its kind of work:
// `evaluation` where computing takes minutes, `correction` where it trains, else `query`.
class SegmentationServiceRpc final : public v1::SegmentationService::CallbackService {
 public:
  // All must outlive it.
  SegmentationServiceRpc(const CallRunner& runner, ModelLoader& models, JobSnapshots& snapshots,
                         ViewImages& images, FindAnswers& finds);

  grpc::ServerUnaryReactor* SegmentViews(grpc::CallbackServerContext* call,
                                         const v1::SegmentViewsRequest* request,
                                         v1::SegmentViewsResponse* response) override;
  grpc::ServerBidiReactor<v1::StreamSegmentsRequest, v1::StreamSegmentsResponse>* StreamSegments(
      grpc::CallbackServerContext* call) override;
  PEPESEG_UNARY(ProposeScales, v1::ProposeScalesRequest, v1::ProposeScalesResponse)
  PEPESEG_UNARY(DecomposeModel, v1::DecomposeModelRequest, v1::DecomposeModelResponse)
  PEPESEG_UNARY(FindSegments, v1::FindSegmentsRequest, v1::FindSegmentsResponse)
  PEPESEG_UNARY(CorrectSegment, v1::CorrectSegmentRequest, v1::CorrectSegmentResponse)

 private:
  SegmentTools Tools() const { return {snapshots_, models_.store(), images_}; }

  const CallRunner& runner_;
  ModelLoader& models_;
  JobSnapshots& snapshots_;
  ViewImages& images_;
  FindAnswers& finds_;
};

}  // namespace pepeseg
