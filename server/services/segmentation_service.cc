#include "server/services/segmentation_service.h"

#include <spdlog/spdlog.h>

#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "core/base/status_macros.h"
#include "server/api/convert.h"
#include "server/api/decomposition.h"
#include "server/api/error.h"
#include "server/api/segment_request.h"
#include "server/rpc/stream.h"
#include "server/rpc/stream_registry.h"
#include "server/services/correct_segment.h"
#include "server/services/segment_answer.h"

namespace pepeseg {
namespace {

// A StreamSegments call: one answer at a time, to the newest request. Each view of an answer is a
// task of its own, and a newer request ends the work on the answer between two views. An error is
// sent as an answer and the stream continues. Key and
// scope are checked when the call begins, and each request is authorised for itself; one that is
// refused ends the stream. The stream also ends if the first request does not come within
// StreamLimits::first_message.
class StreamSegmentsCall final
    : public NewestStream<v1::StreamSegmentsRequest, v1::StreamSegmentsResponse> {
 public:
  StreamSegmentsCall(const CallRunner& runner, const SegmentTools& tools,
                     std::filesystem::path data_folder, CallOrigin origin)
      : NewestStream(&runner.streams(), &runner.pools().query),
        runner_(runner),
        tools_(tools),
        data_folder_(std::move(data_folder)),
        origin_(std::move(origin)) {}

 private:
  Step Work(bool io_ok) override;
  // Authorises a request, or the call itself while there is no request.
  absl::Status Authorize(const v1::StreamSegmentsRequest& request);
  // Begins the answer to `request_`, in `message_`.
  absl::Status BeginAnswer();
  // Computes the next view of the answer.
  Step ContinueAnswer();
  // Sends the answer, or `status` in its place if that is an error.
  Step Send(const absl::Status& status);

  const CallRunner& runner_;
  const SegmentTools tools_;
  const std::filesystem::path data_folder_;
  const CallOrigin origin_;
  const absl::Time begin_ = absl::Now();
  bool admitted_ = false;    // the caller may use this stream
  bool asked_ = false;       // a request has come
  AuthorizedCaller caller_;  // of the newest request
  // The request that is being answered.
  v1::StreamSegmentsRequest request_;
  absl::Time answer_begin_;
  std::unique_ptr<SegmentAnswer> answer_;  // null: none is being computed
};

absl::Status StreamSegmentsCall::Authorize(const v1::StreamSegmentsRequest& request) {
  ASSIGN_OR_RETURN(caller_, runner_.authorizer().Authorize(origin_, request));
  absl::Status status;
  // The stream is counted once, for the first caller; later requests are authorised only.
  if (!admitted_) status = Admit(OwnerOf(caller_, origin_));
  admitted_ = status.ok();
  return status;
}

absl::Status StreamSegmentsCall::BeginAnswer() {
  message_.Clear();
  message_.set_sequence(request_.sequence());
  answer_begin_ = absl::Now();
  // Each request of a stream counts as a query.
  RETURN_IF_ERROR(runner_.quotas().Admit(caller_.project, request_));
  if (AsksSam(request_.segment())) {
    const char* const field =
        request_.segment().sam_borders() ? "segment.sam_borders" : "segment.sam_clicks";
    return BadField(field, "true", "takes too long for a stream of answers; call SegmentViews");
  }
  const auto check = [this] {
    return cancelled() || superseded() ? absl::CancelledError("a newer request has come")
                                       : absl::OkStatus();
  };
  request_.mutable_segment()->set_sam_clicks(false);
  request_.mutable_segment()->set_sam_borders(false);
  const QueryCall call = {absl::ZeroDuration(), caller_.scenes, check};
  ASSIGN_OR_RETURN(
      answer_, SegmentAnswer::Begin(tools_, call, request_.segment(), message_.mutable_segment()));
  return absl::OkStatus();
}

Stream::Step StreamSegmentsCall::ContinueAnswer() {
  const std::optional<absl::Status> status = answer_->SegmentNext();
  if (status) answer_.reset();
  if (status && !absl::IsCancelled(*status)) return Send(*status);
  // For the next view, or the newer request.
  Wake();
  return {Next::kIdle, absl::OkStatus()};
}

Stream::Step StreamSegmentsCall::Send(const absl::Status& status) {
  const absl::Time end = absl::Now();
  runner_.pools().query.latencies().Record(end - answer_begin_, end);
  if (status.ok()) return {Next::kIo, absl::OkStatus()};
  v1::Status error = ToProto(status);
  const ClientErrorRules rules = {data_folder_, origin_.request_id};
  // The interceptor sees only the status of the stream, not the errors in its messages.
  if (HidePrivateText(rules, error)) {
    spdlog::warn("StreamSegments: {}, request {}", status.ToString(), origin_.request_id);
  }
  *message_.mutable_error() = FlatError(error);
  return {Next::kIo, absl::OkStatus()};
}

Stream::Step StreamSegmentsCall::Work(bool) {
  if (answer_ != nullptr) return ContinueAnswer();
  std::optional<v1::StreamSegmentsRequest> request = TakeNewest();
  if (request || !admitted_) {
    v1::StreamSegmentsRequest none;
    absl::Status status = Authorize(request ? *request : none);
    if (!status.ok()) return {Next::kEnd, std::move(status)};
  }
  // The limit is for the first request only: a client may think between clicks for as long as it
  // likes.
  asked_ = asked_ || request.has_value();
  const absl::Duration first_message = runner_.streams().limits().first_message;
  if (!asked_ && absl::Now() - begin_ > first_message) {
    return {Next::kEnd, TooSlowError(first_message)};
  }
  if (!request) return {all_read() ? Next::kEnd : Next::kIdle, absl::OkStatus()};
  request_ = *std::move(request);
  const absl::Status begun = BeginAnswer();
  // A refusal is an answer, so that the stream survives it.
  return begun.ok() ? ContinueAnswer() : Send(begun);
}

}  // namespace

SegmentationServiceRpc::SegmentationServiceRpc(const CallRunner& runner, ModelLoader& models,
                                               JobSnapshots& snapshots, ViewImages& images,
                                               FindAnswers& finds)
    : runner_(runner), models_(models), snapshots_(snapshots), images_(images), finds_(finds) {}

absl::Status SegmentationServiceRpc::ProposeScales(const UnaryCall& call,
                                                   const v1::ProposeScalesRequest& request,
                                                   v1::ProposeScalesResponse* response) const {
  Stopwatch stopwatch;
  ASSIGN_OR_RETURN(const ResidentModel model,
                   snapshots_.LoadWithFeatures(call.scenes(), request.model(), "model"));
  v1::QueryTiming& timing = *response->mutable_timing();
  *timing.mutable_queue() = ToProto(call.queued);
  *timing.mutable_load() = ToProto(stopwatch.Lap());
  RETURN_IF_ERROR(call.CheckWanted());  // a load takes long
  const SegmentRequestReader reader(model->model(), model.id, models_.store());
  ASSIGN_OR_RETURN(const ProposeRequest asked, reader.Read(request));
  const absl::StatusOr<Proposals> proposals = model->Propose(asked);
  RETURN_IF_ERROR(AtField(proposals.status(), "prompt"));
  *timing.mutable_compute() = ToProto(stopwatch.Lap());
  RETURN_IF_ERROR(FillProposals(*proposals, request.mask_encoding(), response));
  *timing.mutable_encode() = ToProto(stopwatch.Lap());
  SetModel(model, response);
  return CheckAnswerSize(response->ByteSizeLong());
}

absl::Status SegmentationServiceRpc::DecomposeModel(const UnaryCall& call,
                                                    const v1::DecomposeModelRequest& request,
                                                    v1::DecomposeModelResponse* response) const {
  ASSIGN_OR_RETURN(const std::vector<double> scales, ReadScales(request.scales(), "scales"));
  Stopwatch stopwatch;
  ASSIGN_OR_RETURN(const ResidentModel model,
                   snapshots_.LoadWithFeatures(call.scenes(), request.model(), "model"));
  v1::QueryTiming& timing = *response->mutable_timing();
  *timing.mutable_queue() = ToProto(call.queued);
  *timing.mutable_load() = ToProto(stopwatch.Lap());
  // A decomposition that was begun is finished, even if the client is gone: it is kept for the next
  // request.
  RETURN_IF_ERROR(call.CheckWanted());
  RETURN_IF_ERROR(model->Decompose(scales, [&](const Decomposition& whole) {
    *timing.mutable_compute() = ToProto(stopwatch.Lap());
    for (const Decomposition::Level& level : whole.levels) {
      *response->add_levels() = LevelToProto(level, model->model());
    }
    return absl::OkStatus();
  }));
  *timing.mutable_encode() = ToProto(stopwatch.Lap());
  SetModel(model, response);
  return CheckAnswerSize(response->ByteSizeLong());
}

absl::Status SegmentationServiceRpc::FindSegments(const UnaryCall& call,
                                                  const v1::FindSegmentsRequest& request,
                                                  v1::FindSegmentsResponse* response) const {
  return finds_.Find(call, request, response);
}

absl::Status SegmentationServiceRpc::CorrectSegment(const UnaryCall& call,
                                                    const v1::CorrectSegmentRequest& request,
                                                    v1::CorrectSegmentResponse* response) const {
  return AnswerCorrectSegment(call, models_, request, response);
}

grpc::ServerUnaryReactor* SegmentationServiceRpc::SegmentViews(
    grpc::CallbackServerContext* call, const v1::SegmentViewsRequest* request,
    v1::SegmentViewsResponse* response) {
  // Calls that compute run on `query`, those that wait for SAM on `border`, those that compute for
  // long on `evaluation`, and those of other services that only read the store on `io`, so that
  // none of them waits for a slower kind. Whether SAM helps by default is known when the model is.
  WorkerPool& pool = AsksSam(*request) ? runner_.pools().border : runner_.pools().query;
  return runner_.RunInParts(
      pool, {call, request},
      [this, request, response](const UnaryCall& unary) -> absl::StatusOr<AnswerParts> {
        const UnaryRequest asked = unary;
        const QueryCall query = {unary.queued, unary.scenes(),
                                 [asked] { return asked.CheckWanted(); }};
        ASSIGN_OR_RETURN(std::shared_ptr<SegmentAnswer> answer,
                         SegmentAnswer::Begin(Tools(), query, *request, response));
        WorkerPool* const rest = answer->asks_sam() ? &runner_.pools().border : nullptr;
        return AnswerParts{[answer = std::move(answer)] { return answer->SegmentNext(); }, rest};
      });
}

grpc::ServerBidiReactor<v1::StreamSegmentsRequest, v1::StreamSegmentsResponse>*
SegmentationServiceRpc::StreamSegments(grpc::CallbackServerContext* call) {
  const auto stream = std::make_shared<StreamSegmentsCall>(runner_, Tools(), models_.data_folder(),
                                                           OriginOf(*call));
  stream->BeginReading();
  return stream.get();  // owns itself until OnDone
}

}  // namespace pepeseg
