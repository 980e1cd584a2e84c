#include "server/services/evaluation_service.h"

#include <vector>

#include "core/base/status_macros.h"
#include "server/api/convert.h"
#include "server/api/evaluation.h"
#include "server/services/segment_answer.h"

namespace pepeseg {

absl::Status EvaluationServiceRpc::Evaluate(const UnaryCall& call,
                                            const v1::EvaluateModelRequest& request,
                                            v1::EvaluateModelResponse* response) const {
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

grpc::ServerUnaryReactor* EvaluationServiceRpc::EvaluateModel(
    grpc::CallbackServerContext* call, const v1::EvaluateModelRequest* request,
    v1::EvaluateModelResponse* response) {
  return runner_.Run(runner_.pools().evaluation, {call, request},
                     [this, request, response](const UnaryCall& unary) {
                       return Evaluate(unary, *request, response);
                     });
}

}  // namespace pepeseg
