#include "server/services/segmentation_service.h"

#include "core/base/status_macros.h"
#include "server/api/rows_to_proto.h"
#include "server/rpc/unary.h"
#include "server/services/answer_size.h"
#include "server/services/decompose_answer.h"
#include "server/services/evaluate_answer.h"
#include "server/services/export_selection.h"
#include "server/services/model_lookup.h"
#include "server/services/render_answer.h"
#include "server/services/segment_answer.h"
#include "server/services/segment_stream.h"
#include "server/services/stopwatch.h"

namespace pepeseg {
namespace {

absl::Status AnswerEvaluate(const UnaryCall& call, const ServiceContext& context,
                            const v1::EvaluateRequest& request, v1::EvaluateResponse* response) {
  ASSIGN_OR_RETURN(const OneClickOptions options, OneClickOptionsFromProto(request.options()));
  ASSIGN_OR_RETURN(const ResidentModel model,
                   LoadModelWithFeatures(context, request.model(), "model"));
  RETURN_IF_ERROR(call.CheckWanted());
  ASSIGN_OR_RETURN(const std::vector<LabeledView> views,
                   ReadLabels(request, model.segmenter->model()));
  Stopwatch stopwatch;
  ASSIGN_OR_RETURN(
      const OneClickScores scores,
      EvaluateOneClick(*model.segmenter, views, options, [&] { return call.CheckWanted(); }));
  *response->mutable_compute() = ToProto(stopwatch.Lap());
  FillAnswer(scores, request, model.segmenter->model(), response);
  *response->mutable_options() = ToProto(options);
  response->set_model(model.name);
  return CheckAnswerSize(response->ByteSizeLong());
}

}  // namespace

grpc::ServerUnaryReactor* SegmentationServiceRpc::Segment(grpc::CallbackServerContext* call,
                                                          const v1::SegmentRequest* request,
                                                          v1::SegmentResponse* response) {
  return RunOnQueryPool(
      {call, request}, context_, [this, request, response](const UnaryCall& unary) {
        return AnswerSegment({unary.queued, [&unary] { return unary.cancelled(); }}, context_,
                             *request, response);
      });
}

grpc::ServerBidiReactor<v1::SegmentStreamRequest, v1::SegmentStreamResponse>*
SegmentationServiceRpc::SegmentStream(grpc::CallbackServerContext* call) {
  const auto stream = std::make_shared<SegmentStreamCall>(context_, OriginOf(*call));
  stream->BeginReading();
  return stream.get();  // owns itself until OnDone
}

grpc::ServerUnaryReactor* SegmentationServiceRpc::ProposeScales(
    grpc::CallbackServerContext* call, const v1::ProposeScalesRequest* request,
    v1::ProposeScalesResponse* response) {
  return RunOnQueryPool({call, request}, context_,
                        [this, request, response](const UnaryCall& unary) {
                          return AnswerProposeScales(unary, context_, *request, response);
                        });
}

grpc::ServerUnaryReactor* SegmentationServiceRpc::Evaluate(grpc::CallbackServerContext* call,
                                                           const v1::EvaluateRequest* request,
                                                           v1::EvaluateResponse* response) {
  return RunOnEvaluationPool({call, request}, context_,
                             [this, request, response](const UnaryCall& unary) {
                               return AnswerEvaluate(unary, context_, *request, response);
                             });
}

grpc::ServerUnaryReactor* SegmentationServiceRpc::Decompose(grpc::CallbackServerContext* call,
                                                            const v1::DecomposeRequest* request,
                                                            v1::DecomposeResponse* response) {
  return RunOnEvaluationPool({call, request}, context_,
                             [this, request, response](const UnaryCall& unary) {
                               return AnswerDecompose(unary, context_, *request, response);
                             });
}

grpc::ServerUnaryReactor* SegmentationServiceRpc::Render(grpc::CallbackServerContext* call,
                                                         const v1::RenderRequest* request,
                                                         v1::RenderResponse* response) {
  return RunOnQueryPool({call, request}, context_,
                        [this, request, response](const UnaryCall& unary) {
                          return AnswerRender(unary, context_, *request, response);
                        });
}

grpc::ServerWriteReactor<v1::ExportSelectionResponse>* SegmentationServiceRpc::ExportSelection(
    grpc::CallbackServerContext* call, const v1::ExportSelectionRequest* request) {
  const auto stream = std::make_shared<ExportSelectionStream>(context_, call, *request);
  stream->Begin();
  return stream.get();  // owns itself until OnDone
}

}  // namespace pepeseg
