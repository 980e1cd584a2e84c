#include "server/services/segment_answer.h"

#include <utility>
#include <vector>

#include "core/base/status_macros.h"
#include "core/prompt/propose_scales.h"
#include "core/prompt/resolve_prompt.h"
#include "server/api/encode_mask.h"
#include "server/api/pixel_frame.h"
#include "server/api/rows_to_proto.h"
#include "server/services/answer_size.h"
#include "server/services/model_lookup.h"
#include "server/services/segment_question.h"
#include "server/services/stopwatch.h"

namespace pepeseg {
namespace {

v1::ProposeScalesResponse::Kind ProtoKind(ProposalKind kind) {
  switch (kind) {
    case ProposalKind::kUnnamed:
      break;
    case ProposalKind::kPart:
      return v1::ProposeScalesResponse::KIND_PART;
    case ProposalKind::kObject:
      return v1::ProposeScalesResponse::KIND_OBJECT;
    case ProposalKind::kGroup:
      return v1::ProposeScalesResponse::KIND_GROUP;
  }
  return v1::ProposeScalesResponse::KIND_UNSPECIFIED;
}

}  // namespace

// One view after the other, so that a client that is gone costs no more than one of them.
absl::Status AnswerSegment(const QueryCall& call, const ServiceContext& context,
                           const v1::SegmentRequest& request, v1::SegmentResponse* response) {
  Stopwatch stopwatch;
  ASSIGN_OR_RETURN(const ResidentModel model,
                   LoadModelWithFeatures(context, request.model(), "model"));
  *response->mutable_timing()->mutable_queue() = ToProto(call.queued);
  *response->mutable_timing()->mutable_load() = ToProto(stopwatch.Lap());
  ASSIGN_OR_RETURN(const SegmentQuestion question, ReadQuestion(context, model, request));
  ASSIGN_OR_RETURN(const Query query,
                   ResolvePrompt(*model.segmenter, question.prompt, question.granularity));
  absl::Duration compute;
  absl::Duration encode;
  size_t num_bytes = 0;
  AnswerFrame frame(request.frame());
  for (const ModelView& target : question.targets) {
    if (call.given_up()) return absl::CancelledError("nobody waits for the answer any more");
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

absl::Status AnswerProposeScales(const UnaryCall& call, const ServiceContext& context,
                                 const v1::ProposeScalesRequest& request,
                                 v1::ProposeScalesResponse* response) {
  Stopwatch stopwatch;
  ASSIGN_OR_RETURN(const ResidentModel model,
                   LoadModelWithFeatures(context, request.model(), "model"));
  v1::QueryTiming& timing = *response->mutable_timing();
  *timing.mutable_queue() = ToProto(call.queued);
  *timing.mutable_load() = ToProto(stopwatch.Lap());
  RETURN_IF_ERROR(call.CheckWanted());  // a load takes long
  ASSIGN_OR_RETURN(const ProposalQuestion question, ReadQuestion(context, model, request));
  ASSIGN_OR_RETURN(
      const ScaleProposals proposals,
      ProposeScales(*model.segmenter, question.view, question.points, question.max_proposals));
  *timing.mutable_compute() = ToProto(stopwatch.Lap());
  AnswerFrame frame(request.frame());
  for (const ScaleProposal& proposal : proposals.ladder) {
    v1::ProposeScalesResponse::Proposal& out = *response->add_proposals();
    out.set_scale_quantile(proposal.result.scale);
    out.set_threshold(proposal.result.threshold);
    out.set_scale_units(proposal.result.scale_units);
    out.set_support(proposal.support);
    out.set_stability(proposal.stability);
    out.set_kind(ProtoKind(proposal.kind));
    ASSIGN_OR_RETURN(*out.mutable_mask(),
                     EncodeMask(question.view.name, frame.Take(question.view, proposal.result),
                                request.mask_encoding()));
  }
  *timing.mutable_encode() = ToProto(stopwatch.Lap());
  response->set_best(proposals.best);
  response->set_model(model.name);
  return CheckAnswerSize(response->ByteSizeLong());
}

}  // namespace pepeseg
