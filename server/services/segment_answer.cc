#include "server/services/segment_answer.h"

#include <spdlog/spdlog.h>

#include <optional>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "core/base/status_macros.h"
#include "core/prompt/propose_scales.h"
#include "core/prompt/resolve_prompt.h"
#include "server/api/client_error.h"
#include "server/api/convert.h"
#include "server/api/error.h"
#include "server/api/request_image.h"
#include "server/api/segment_request.h"

namespace pepeseg {

absl::Duration Stopwatch::Lap() {
  const absl::Time now = absl::Now();
  const absl::Duration lap = now - start_;
  start_ = now;
  return lap;
}

absl::Status CheckAnswerSize(size_t num_bytes) {
  if (num_bytes <= kAnswerBytes) return absl::OkStatus();
  return WithDetail(absl::ResourceExhaustedError(absl::StrCat(
                        "the answer has over ", kAnswerBytes, " bytes: ask for fewer views, for ",
                        "frame PIXEL_FRAME_VIEW, or for a smaller max_side")),
                    {.reason = "ANSWER_TOO_LARGE",
                     .limit = absl::StrCat(kAnswerBytes, " bytes"),
                     .value = absl::StrCat(num_bytes, " bytes")});
}

absl::Status SegmentAnswers::Segment(const QueryCall& call, const v1::SegmentViewsRequest& request,
                                     v1::SegmentViewsResponse* response) const {
  Stopwatch stopwatch;
  ASSIGN_OR_RETURN(const ResidentModel model, models_.LoadWithFeatures(request.model(), "model"));
  *response->mutable_timing()->mutable_queue() = ToProto(call.queued);
  *response->mutable_timing()->mutable_load() = ToProto(stopwatch.Lap());
  const SegmentRequestReader reader(model.segmenter->model(), model.row, models_.store());
  ASSIGN_OR_RETURN(const SegmentQuery asked, reader.Read(request));
  ASSIGN_OR_RETURN(const Query query,
                   ResolvePrompt(*model.segmenter, asked.prompt, asked.granularity));
  absl::Duration compute;
  absl::Duration encode;
  size_t num_bytes = 0;
  AnswerFrame frame(request.frame());
  for (const ModelView& target : asked.targets) {
    if (call.given_up()) return absl::CancelledError("nobody waits for the answer any more");
    // One view at a time, although Segment takes many: a client that is gone costs at most one
    // view, and the size is checked before the next one is computed.
    ASSIGN_OR_RETURN(auto results,
                     model.segmenter->Segment(query, {&target, 1}, request.want_similarity()));
    const SegmentResult result = frame.Take(target, std::move(results.front()));
    compute += stopwatch.Lap();
    ASSIGN_OR_RETURN(*response->add_masks(),
                     EncodeMask(target.name, result, request.mask_encoding()));
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

absl::Status SegmentAnswers::ProposeScales(const UnaryCall& call,
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
  ASSIGN_OR_RETURN(
      const ScaleProposals proposals,
      pepeseg::ProposeScales(*model.segmenter, query.view, query.points, query.max_proposals));
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
  if (status.ok()) {
    status = SegmentAnswers(models_).Segment(call, request.segment(), message_.mutable_segment());
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

}  // namespace pepeseg
