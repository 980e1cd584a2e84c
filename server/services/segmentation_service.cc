#include "server/services/segmentation_service.h"

#include <memory>
#include <vector>

#include "core/base/status_macros.h"
#include "server/api/convert.h"
#include "server/api/decomposition.h"
#include "server/api/evaluation.h"
#include "server/services/label_answer.h"

namespace pepeseg {

absl::Status SegmentationServiceRpc::AnswerEvaluate(const UnaryCall& call,
                                                    const v1::EvaluateRequest& request,
                                                    v1::EvaluateResponse* response) const {
  // Options before the model, so that a wrong request does not load one.
  ASSIGN_OR_RETURN(const OneClickOptions options, OneClickOptionsFromProto(request.options()));
  ASSIGN_OR_RETURN(const ResidentModel model, models_.LoadWithFeatures(request.model(), "model"));
  RETURN_IF_ERROR(call.CheckWanted());
  ASSIGN_OR_RETURN(const std::vector<LabeledView> views,
                   ReadLabels(request, model.segmenter->model()));
  Stopwatch stopwatch;
  ASSIGN_OR_RETURN(
      const OneClickScores scores,
      EvaluateOneClick(*model.segmenter, views, options, [&] { return call.CheckWanted(); }));
  *response->mutable_compute() = ToProto(stopwatch.Lap());
  // The time that is reported is that of the scores alone: decoding the labels is not part of it.
  FillAnswer(scores, request, model.segmenter->model(), response);
  *response->mutable_options() = ToProto(options);
  response->set_model(model.name);
  return CheckAnswerSize(response->ByteSizeLong());
}

absl::Status SegmentationServiceRpc::AnswerDecompose(const UnaryCall& call,
                                                     const v1::DecomposeRequest& request,
                                                     v1::DecomposeResponse* response) const {
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

grpc::ServerUnaryReactor* SegmentationServiceRpc::Segment(grpc::CallbackServerContext* call,
                                                          const v1::SegmentRequest* request,
                                                          v1::SegmentResponse* response) {
  return runner_.Run(
      // Calls that compute run on `query`, those that compute for long on `evaluation`, and those
      // that only read the store on `io`, so that none of them waits for a slower kind.
      runner_.pools().query, {call, request}, [this, request, response](const UnaryCall& unary) {
        const QueryCall query = {unary.queued, [&unary] { return unary.cancelled(); }};
        return segment_answers_.Segment(query, *request, response);
      });
}

grpc::ServerBidiReactor<v1::SegmentStreamRequest, v1::SegmentStreamResponse>*
SegmentationServiceRpc::SegmentStream(grpc::CallbackServerContext* call) {
  const auto stream = std::make_shared<SegmentStreamCall>(runner_, models_, OriginOf(*call));
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

grpc::ServerUnaryReactor* SegmentationServiceRpc::Evaluate(grpc::CallbackServerContext* call,
                                                           const v1::EvaluateRequest* request,
                                                           v1::EvaluateResponse* response) {
  return runner_.Run(runner_.pools().evaluation, {call, request},
                     [this, request, response](const UnaryCall& unary) {
                       return AnswerEvaluate(unary, *request, response);
                     });
}

grpc::ServerUnaryReactor* SegmentationServiceRpc::Decompose(grpc::CallbackServerContext* call,
                                                            const v1::DecomposeRequest* request,
                                                            v1::DecomposeResponse* response) {
  return runner_.Run(runner_.pools().evaluation, {call, request},
                     [this, request, response](const UnaryCall& unary) {
                       return AnswerDecompose(unary, *request, response);
                     });
}

grpc::ServerUnaryReactor* SegmentationServiceRpc::Render(grpc::CallbackServerContext* call,
                                                         const v1::RenderRequest* request,
                                                         v1::RenderResponse* response) {
  return runner_.Run(runner_.pools().query, {call, request},
                     [this, request, response](const UnaryCall& unary) {
                       return render_answers_.Render(unary, *request, response);
                     });
}

grpc::ServerUnaryReactor* SegmentationServiceRpc::CreateLabel(grpc::CallbackServerContext* call,
                                                              const v1::CreateLabelRequest* request,
                                                              v1::Label* response) {
  return runner_.Run(runner_.pools().query, {call, request},
                     [this, request, response](const UnaryCall&) {
                       return AnswerCreateLabel(models_, *request, response);
                     });
}

grpc::ServerUnaryReactor* SegmentationServiceRpc::ListLabels(grpc::CallbackServerContext* call,
                                                             const v1::ListLabelsRequest* request,
                                                             v1::ListLabelsResponse* response) {
  return runner_.Run(runner_.pools().io, {call, request},
                     [this, request, response](const UnaryCall&) {
                       return AnswerListLabels(models_.store(), *request, response);
                     });
}

grpc::ServerUnaryReactor* SegmentationServiceRpc::DeleteLabel(grpc::CallbackServerContext* call,
                                                              const v1::DeleteLabelRequest* request,
                                                              google::protobuf::Empty*) {
  return runner_.Run(runner_.pools().io, {call, request}, [this, request](const UnaryCall&) {
    return AnswerDeleteLabel(models_.store(), *request);
  });
}

grpc::ServerUnaryReactor* SegmentationServiceRpc::Select(grpc::CallbackServerContext* call,
                                                         const v1::SelectRequest* request,
                                                         v1::Selection* response) {
  return runner_.Run(runner_.pools().query, {call, request},
                     [this, request, response](const UnaryCall& unary) {
                       return selection_answers_.Select(unary, *request, response);
                     });
}

grpc::ServerUnaryReactor* SegmentationServiceRpc::CombineSelections(
    grpc::CallbackServerContext* call, const v1::CombineSelectionsRequest* request,
    v1::Selection* response) {
  return runner_.Run(runner_.pools().query, {call, request},
                     [this, request, response](const UnaryCall&) {
                       return selection_answers_.Combine(*request, response);
                     });
}

grpc::ServerUnaryReactor* SegmentationServiceRpc::UndoSelection(
    grpc::CallbackServerContext* call, const v1::UndoSelectionRequest* request,
    v1::Selection* response) {
  return runner_.Run(runner_.pools().io, {call, request},
                     [this, request, response](const UnaryCall&) {
                       return selection_answers_.Undo(*request, response);
                     });
}

grpc::ServerUnaryReactor* SegmentationServiceRpc::GetSelection(
    grpc::CallbackServerContext* call, const v1::GetSelectionRequest* request,
    v1::Selection* response) {
  return runner_.Run(runner_.pools().io, {call, request},
                     [this, request, response](const UnaryCall&) {
                       return selection_answers_.Get(*request, response);
                     });
}

grpc::ServerUnaryReactor* SegmentationServiceRpc::ListSelections(
    grpc::CallbackServerContext* call, const v1::ListSelectionsRequest* request,
    v1::ListSelectionsResponse* response) {
  return runner_.Run(runner_.pools().io, {call, request},
                     [this, request, response](const UnaryCall&) {
                       return selection_answers_.List(*request, response);
                     });
}

grpc::ServerUnaryReactor* SegmentationServiceRpc::DeleteSelection(
    grpc::CallbackServerContext* call, const v1::DeleteSelectionRequest* request,
    google::protobuf::Empty*) {
  return runner_.Run(runner_.pools().io, {call, request}, [this, request](const UnaryCall&) {
    return selection_answers_.Delete(*request);
  });
}

grpc::ServerWriteReactor<v1::ExportSelectionResponse>* SegmentationServiceRpc::ExportSelection(
    grpc::CallbackServerContext* call, const v1::ExportSelectionRequest* request) {
  const auto stream = std::make_shared<ExportSelectionStream>(
      ExportSelectionStream::Parts{runner_, models_, selections_}, call, *request);
  stream->Begin();
  return stream.get();  // owns itself until OnDone
}

}  // namespace pepeseg
