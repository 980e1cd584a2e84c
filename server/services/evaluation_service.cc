#include "server/services/evaluation_service.h"

#include <string>
#include <utility>

#include "absl/functional/function_ref.h"
#include "core/base/status_macros.h"
#include "server/api/convert.h"
#include "server/api/convert_evaluation.h"
#include "server/api/error.h"
#include "server/api/evaluation_prompts.h"
#include "server/api/evaluation_views.h"
#include "server/api/segment_request.h"
#include "server/api/truth_frames.h"
#include "server/services/stored_photographs.h"

namespace pepeseg {

namespace {

// Reads what a request asks of its model.
absl::StatusOr<EvaluationRequest> ReadRequest(const v1::EvaluateModelRequest& request,
                                              const SegmentRequestReader& reader,
                                              const TruthFrames& frames,
                                              absl::FunctionRef<absl::Status()> check_wanted) {
  EvaluationRequest read;
  read.accept_trained_views = request.options().accept_trained_views();
  if (request.options().protocol() == v1::EVALUATION_PROTOCOL_SAM_AGREEMENT) {
    ASSIGN_OR_RETURN(read.sam_views, ReadSamViews(request, reader.model(), check_wanted, frames));
    return read;
  }
  ASSIGN_OR_RETURN(read.views, ReadTruthViews(request, reader.model(), check_wanted, frames));
  ASSIGN_OR_RETURN(read.prompts, ReadEntityPrompts(request, read.views, reader, frames));
  return read;
}

}  // namespace

EvaluationServiceRpc::EvaluationServiceRpc(const CallRunner& runner, ModelLoader& models,
                                           const BlobStore& blobs,
                                           const PhotographProcess& photographs)
    : runner_(runner), models_(models), blobs_(blobs), photographs_(photographs) {}

absl::Status EvaluationServiceRpc::EvaluateModel(const UnaryCall& call,
                                                 const v1::EvaluateModelRequest& request,
                                                 v1::EvaluateModelResponse* response) const {
  // Options before the model, so that a wrong request does not load one.
  ASSIGN_OR_RETURN(const EvaluationOptions options, EvaluationOptionsFromProto(request.options()));
  ASSIGN_OR_RETURN(const ResidentModel model,
                   models_.LoadWithFeatures(call.scenes(), request.model(), "model"));
  const auto check_wanted = [&] { return call.CheckWanted(); };
  RETURN_IF_ERROR(check_wanted());
  const SegmentRequestReader reader(model->model(), model.id, models_.store());
  const auto wanted = [&] { return call.CheckWanted().ok(); };
  StoredPhotographs photographs(models_.store(), blobs_, photographs_, model.id, wanted);
  ASSIGN_OR_RETURN(const TruthFrames frames,
                   TruthFrames::Choose(request, reader.model(), photographs, check_wanted));
  ASSIGN_OR_RETURN(EvaluationRequest asked, ReadRequest(request, reader, frames, check_wanted));
  // The time that is reported is that of the scores alone: decoding images is not part of it.
  Stopwatch stopwatch;
  ASSIGN_OR_RETURN(const EvaluationResult result,
                   pepeseg::Evaluate(model->segmenter(), std::move(asked), options, check_wanted));
  *response->mutable_compute() = ToProto(stopwatch.Lap());
  FillEvaluation(result, request.frame(), model->model(), response);
  *response->mutable_options() = ToProto(options, request.options().accept_trained_views());
  response->set_model(model.name);
  for (std::string& note : frames.Notes()) response->add_notes(std::move(note));
  return CheckAnswerSize(response->ByteSizeLong());
}

}  // namespace pepeseg
