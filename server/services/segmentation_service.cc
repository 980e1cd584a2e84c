#include "server/services/segmentation_service.h"

#include <spdlog/spdlog.h>

#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "core/base/status_macros.h"
#include "core/prompt/propose_scales.h"
#include "core/prompt/resolve_prompt.h"
#include "server/api/convert.h"
#include "server/api/decomposition.h"
#include "server/api/error.h"
#include "server/api/request_image.h"
#include "server/api/segment_request.h"
#include "server/rpc/stream.h"
#include "server/rpc/stream_registry.h"

namespace pepeseg {
namespace {

// A query on its pool thread, from a unary call or a stream.
struct QueryCall {
  absl::Duration queued;           // how long it waited for the thread
  std::function<bool()> given_up;  // returns whether the client no longer waits for the answer
};

// Segments one view after the other, and looks before each whether the client still waits. Blocks
// for as long as the model takes to load. CANCELLED: the client does not wait.
absl::Status Segment(ModelLoader& models, BorderRefiner& borders, const QueryCall& call,
                     const v1::SegmentViewsRequest& request, v1::SegmentViewsResponse* response) {
  if (request.sam_borders()) RETURN_IF_ERROR(borders.CheckAvailable());
  Stopwatch stopwatch;
  ASSIGN_OR_RETURN(const ResidentModel model, models.LoadWithFeatures(request.model(), "model"));
  *response->mutable_timing()->mutable_queue() = ToProto(call.queued);
  *response->mutable_timing()->mutable_load() = ToProto(stopwatch.Lap());
  const SegmentRequestReader reader(model.segmenter->model(), model.row, models.store());
  ASSIGN_OR_RETURN(const SegmentQuery asked, reader.Read(request));
  ASSIGN_OR_RETURN(const Query query,
                   ResolvePrompt(*model.segmenter, asked.prompt, asked.granularity));
  absl::Duration compute;
  absl::Duration encode;
  size_t num_bytes = 0;
  AnswerFrame frame(request.frame());
  SegmentOptions options = asked.options;
  options.want_similarity = options.want_similarity || request.sam_borders();
  for (const ModelView& target : asked.targets) {
    if (call.given_up()) return absl::CancelledError("nobody waits for the answer any more");
    // One view at a time, although Segment takes many: a client that is gone costs at most one
    // view, and the size is checked before the next one is computed.
    ASSIGN_OR_RETURN(auto results, model.segmenter->Segment(query, {&target, 1}, options));
    auto border_image = v1::SegmentViewsResponse::BORDER_IMAGE_UNSPECIFIED;
    if (request.sam_borders()) {
      ASSIGN_OR_RETURN(border_image,
                       borders.Refine(
                           model, target, [&call] { return !call.given_up(); }, results.front()));
      if (!asked.options.want_similarity) results.front().similarity.clear();
    }
    const SegmentResult result = frame.Take(target, std::move(results.front()));
    compute += stopwatch.Lap();
    ASSIGN_OR_RETURN(*response->add_masks(),
                     EncodeMask(target.name, result, request.mask_encoding()));
    response->mutable_masks(response->masks_size() - 1)->set_border_image(border_image);
    num_bytes += response->masks(response->masks_size() - 1).ByteSizeLong();
    RETURN_IF_ERROR(CheckAnswerSize(num_bytes));
    response->set_scale_quantile(result.scale);
    response->set_scale_units(result.scale_units);
    response->set_threshold(result.threshold);
    encode += stopwatch.Lap();
  }
  *response->mutable_timing()->mutable_compute() = ToProto(compute);
  *response->mutable_timing()->mutable_encode() = ToProto(encode);
  response->set_model(model.name);
  return absl::OkStatus();
}

// A StreamSegments call: one answer at a time, to the newest request. A newer request ends the work
// on the answer between two views; an error is sent as an answer and the stream continues. Key and
// scope are checked when the call begins, and each request is authorised for itself; one that is
// refused ends the stream. The stream also ends if the first request does not come within
// StreamLimits::first_message.
class StreamSegmentsCall final
    : public NewestStream<v1::StreamSegmentsRequest, v1::StreamSegmentsResponse> {
 public:
  StreamSegmentsCall(const CallRunner& runner, ModelLoader& models, BorderRefiner& borders,
                     CallOrigin origin)
      : NewestStream(&runner.streams(), &runner.pools().query),
        runner_(runner),
        models_(models),
        borders_(borders),
        origin_(std::move(origin)) {}

 private:
  Step Work(bool io_ok) override;
  // Authorises a request, or the call itself while there is no request.
  absl::Status Authorize(v1::StreamSegmentsRequest& request);
  // Fills `message_` with the answer or the error. Returns false if the request was given up.
  bool Answer(const v1::StreamSegmentsRequest& request);

  const CallRunner& runner_;
  ModelLoader& models_;
  BorderRefiner& borders_;
  const CallOrigin origin_;
  const absl::Time begin_ = absl::Now();
  bool admitted_ = false;  // the caller may use this stream
  bool asked_ = false;     // a request has come
  std::string project_;    // the caller's
};

absl::Status StreamSegmentsCall::Authorize(v1::StreamSegmentsRequest& request) {
  const auto caller = runner_.authorizer().AuthorizeAndResolve(origin_, request);
  if (!caller.ok()) return caller.status();
  project_ = caller->project;
  absl::Status status;
  // The stream is counted once, for the first caller; later requests are authorised only.
  if (!admitted_) status = Admit(OwnerOf(*caller, origin_));
  admitted_ = status.ok();
  return status;
}

bool StreamSegmentsCall::Answer(const v1::StreamSegmentsRequest& request) {
  const QueryCall call = {absl::ZeroDuration(), [this] { return cancelled() || superseded(); }};
  message_.Clear();
  message_.set_sequence(request.sequence());
  const absl::Time start = absl::Now();
  // Each request of a stream counts as a query. A refusal is an answer, so that the stream survives
  // it.
  absl::Status status = runner_.quotas().Admit(project_, request);
  if (status.ok() && request.segment().sam_borders()) {
    status = BadField("segment.sam_borders", "true",
                      "takes too long for a stream of answers; call SegmentViews");
  }
  if (status.ok()) {
    status = Segment(models_, borders_, call, request.segment(), message_.mutable_segment());
  }
  // A newer request came, or the stream ends: there is nothing to send.
  if (absl::IsCancelled(status)) return false;
  const absl::Time end = absl::Now();
  runner_.pools().query.latencies().Record(end - start, end);
  if (status.ok()) return true;
  v1::Status error = ToProto(status);
  const ClientErrorRules rules = {models_.data_folder(), origin_.request_id};
  // The interceptor sees only the status of the stream, not the errors in its messages.
  if (HidePrivateText(rules, error)) {
    spdlog::warn("StreamSegments: {}, request {}", status.ToString(), origin_.request_id);
  }
  *message_.mutable_error() = FlatError(error);
  return true;
}

Stream::Step StreamSegmentsCall::Work(bool) {
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
  if (Answer(*request)) return {Next::kIo, absl::OkStatus()};
  Wake();  // for the newer request
  return {Next::kIdle, absl::OkStatus()};
}

}  // namespace

SegmentationServiceRpc::SegmentationServiceRpc(const CallRunner& runner, ModelLoader& models,
                                               BorderRefiner& borders)
    : runner_(runner), models_(models), borders_(borders) {}

absl::Status SegmentationServiceRpc::Propose(const UnaryCall& call,
                                             const v1::ProposeScalesRequest& request,
                                             v1::ProposeScalesResponse* response) const {
  Stopwatch stopwatch;
  ASSIGN_OR_RETURN(const ResidentModel model, models_.LoadWithFeatures(request.model(), "model"));
  v1::QueryTiming& timing = *response->mutable_timing();
  *timing.mutable_queue() = ToProto(call.queued);
  *timing.mutable_load() = ToProto(stopwatch.Lap());
  RETURN_IF_ERROR(call.CheckWanted());  // a load takes long
  const SegmentRequestReader reader(model.segmenter->model(), model.row, models_.store());
  ASSIGN_OR_RETURN(const ProposalQuery query, reader.Read(request));
  ASSIGN_OR_RETURN(const ScaleProposals proposals,
                   pepeseg::ProposeScales(*model.segmenter, query.view, query.points,
                                          {query.max_proposals, query.options}));
  *timing.mutable_compute() = ToProto(stopwatch.Lap());
  AnswerFrame frame(request.frame());
  for (const ScaleProposal& proposal : proposals.ladder) {
    v1::ProposeScalesResponse::Proposal& out = *response->add_proposals();
    out = ProposalToProto(proposal);
    ASSIGN_OR_RETURN(*out.mutable_mask(),
                     EncodeMask(query.view.name, frame.Take(query.view, proposal.result),
                                request.mask_encoding()));
  }
  *timing.mutable_encode() = ToProto(stopwatch.Lap());
  response->set_best(proposals.best);
  response->set_model(model.name);
  return CheckAnswerSize(response->ByteSizeLong());
}

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
  // Calls that compute run on `query`, those that wait for SAM on `border`, those that compute for
  // long on `evaluation`, and those of other services that only read the store on `io`, so that
  // none of them waits for a slower kind.
  WorkerPool& pool = request->sam_borders() ? runner_.pools().border : runner_.pools().query;
  return runner_.Run(pool, {call, request}, [this, request, response](const UnaryCall& unary) {
    const QueryCall query = {unary.queued, [&unary] { return !unary.CheckWanted().ok(); }};
    return Segment(models_, borders_, query, *request, response);
  });
}

grpc::ServerBidiReactor<v1::StreamSegmentsRequest, v1::StreamSegmentsResponse>*
SegmentationServiceRpc::StreamSegments(grpc::CallbackServerContext* call) {
  const auto stream =
      std::make_shared<StreamSegmentsCall>(runner_, models_, borders_, OriginOf(*call));
  stream->BeginReading();
  return stream.get();  // owns itself until OnDone
}

grpc::ServerUnaryReactor* SegmentationServiceRpc::ProposeScales(
    grpc::CallbackServerContext* call, const v1::ProposeScalesRequest* request,
    v1::ProposeScalesResponse* response) {
  return runner_.Run(runner_.pools().query, {call, request},
                     [this, request, response](const UnaryCall& unary) {
                       return Propose(unary, *request, response);
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
