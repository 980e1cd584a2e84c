#include "server/services/segmentation_service.h"

#include <memory>
#include <vector>

#include "core/base/status_macros.h"
#include "server/api/convert.h"
#include "server/api/decomposition.h"

namespace pepeseg {

absl::Status SegmentationServiceRpc::Decompose(const UnaryCall& call,
                                               const v1::DecomposeModelRequest& request,
                                               v1::DecomposeModelResponse* response) const {
  ASSIGN_OR_RETURN(const std::vector<double> scales, ReadScales(request.scales(), "scales"));
  Stopwatch stopwatch;
  ASSIGN_OR_RETURN(const ResidentModel model, models_.LoadWithFeatures(request.model(), "model"));
  v1::QueryTiming& timing = *response->mutable_timing();
  *timing.mutable_queue() = ToProto(call.queued);
  *timing.mutable_load() = ToProto(stopwatch.Lap());
  // A decomposition that was begun is finished, even if the client is gone: it is kept for the next
  // request.
  RETURN_IF_ERROR(call.CheckWanted());
  RETURN_IF_ERROR(model.segmenter->WithDecomposition(scales, [&](const Decomposition& whole) {
    *timing.mutable_compute() = ToProto(stopwatch.Lap());
    for (const Decomposition::Level& level : whole.levels) {
      *response->add_levels() = LevelToProto(level, model.segmenter->model());
    }
    return absl::OkStatus();
  }));
  *timing.mutable_encode() = ToProto(stopwatch.Lap());
  response->set_model(model.name);
  return CheckAnswerSize(response->ByteSizeLong());
}

grpc::ServerUnaryReactor* SegmentationServiceRpc::SegmentViews(
    grpc::CallbackServerContext* call, const v1::SegmentViewsRequest* request,
    v1::SegmentViewsResponse* response) {
  return runner_.Run(
      // Calls that compute run on `query`, those that compute for long on `evaluation`, and those
      // of other services that only read the store on `io`, so that none of them waits for a slower
      // kind.
      runner_.pools().query, {call, request}, [this, request, response](const UnaryCall& unary) {
        const QueryCall query = {unary.queued, [&unary] { return unary.cancelled(); }};
        return segment_answers_.Segment(query, *request, response);
      });
}

grpc::ServerBidiReactor<v1::StreamSegmentsRequest, v1::StreamSegmentsResponse>*
SegmentationServiceRpc::StreamSegments(grpc::CallbackServerContext* call) {
  const auto stream = std::make_shared<StreamSegmentsCall>(runner_, models_, OriginOf(*call));
  stream->BeginReading();
  return stream.get();  // owns itself until OnDone
}

grpc::ServerUnaryReactor* SegmentationServiceRpc::ProposeScales(
    grpc::CallbackServerContext* call, const v1::ProposeScalesRequest* request,
    v1::ProposeScalesResponse* response) {
  return runner_.Run(runner_.pools().query, {call, request},
                     [this, request, response](const UnaryCall& unary) {
                       return segment_answers_.ProposeScales(unary, *request, response);
                     });
}

grpc::ServerUnaryReactor* SegmentationServiceRpc::DecomposeModel(
    grpc::CallbackServerContext* call, const v1::DecomposeModelRequest* request,
    v1::DecomposeModelResponse* response) {
  return runner_.Run(runner_.pools().evaluation, {call, request},
                     [this, request, response](const UnaryCall& unary) {
                       return Decompose(unary, *request, response);
                     });
}

}  // namespace pepeseg
