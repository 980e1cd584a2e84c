#include "server/services/segment_answer.h"

#include <utility>
#include <variant>

#include "absl/memory/memory.h"
#include "absl/strings/str_cat.h"
#include "core/base/status_macros.h"
#include "core/query/change_mask.h"
#include "core/query/resolve_prompt.h"
#include "server/api/convert.h"
#include "server/api/error.h"
#include "server/rpc/call_runner.h"

namespace pepeseg {
namespace {

// Maximum number of views of a request with sam_borders. A view that SAM has not seen takes it one
// to two seconds of a core.
constexpr size_t kMaxBorderTargets = 100;

absl::Status CheckBorderTargets(size_t num_targets) {
  if (num_targets <= kMaxBorderTargets) return absl::OkStatus();
  return BadField("targets", absl::StrCat(num_targets),
                  absl::StrCat("views; with sam_borders a request may have ", kMaxBorderTargets,
                               ": send several requests"));
}

}  // namespace

SegmentAnswer::SegmentAnswer(const SegmentTools& tools, QueryCall call,
                             const v1::SegmentViewsRequest& request,
                             v1::SegmentViewsResponse* response)
    : tools_(tools),
      call_(std::move(call)),
      request_(request),
      response_(response),
      frame_(request.frame()) {}

absl::StatusOr<std::unique_ptr<SegmentAnswer>> SegmentAnswer::Begin(
    const SegmentTools& tools, QueryCall call, const v1::SegmentViewsRequest& request,
    v1::SegmentViewsResponse* response) {
  if (request.sam_borders()) RETURN_IF_ERROR(tools.borders.CheckAvailable());
  auto answer = absl::WrapUnique(new SegmentAnswer(tools, std::move(call), request, response));
  Stopwatch stopwatch;
  ASSIGN_OR_RETURN(answer->model_,
                   tools.models.LoadWithFeatures(answer->call_.scenes, request.model(), "model"));
  v1::QueryTiming& timing = *response->mutable_timing();
  *timing.mutable_queue() = ToProto(answer->call_.queued);
  *timing.mutable_load() = ToProto(stopwatch.Lap());
  const ResidentModel& model = answer->model_;
  const SegmentRequestReader reader(model.segmenter->model(), model.row, tools.models.store());
  ASSIGN_OR_RETURN(answer->asked_, reader.Read(request));
  if (request.sam_borders()) RETURN_IF_ERROR(CheckBorderTargets(answer->asked_.targets.size()));
  ASSIGN_OR_RETURN(answer->query_, ResolvePrompt(*model.segmenter, answer->asked_.prompt,
                                                 answer->asked_.granularity));
  answer->compute_ = stopwatch.Lap();
  return answer;
}

std::optional<absl::Status> SegmentAnswer::SegmentNext() {
  if (call_.given_up()) return absl::CancelledError("the client no longer waits for the answer");
  // The size of the answer is checked before the next view is computed.
  RETURN_IF_ERROR(Segment(asked_.targets[next_]));
  ++next_;
  if (next_ < asked_.targets.size()) return std::nullopt;
  *response_->mutable_timing()->mutable_compute() = ToProto(compute_);
  *response_->mutable_timing()->mutable_encode() = ToProto(encode_);
  response_->set_model(model_.name);
  return absl::OkStatus();
}

const BoxPrompt* SegmentAnswer::BoxIn(const ModelView& target) const {
  // A free camera has no name, and is a target only if it is the prompt's.
  if (target.name != asked_.prompt.view.name) return nullptr;
  return std::get_if<BoxPrompt>(&asked_.prompt.what);
}

absl::Status SegmentAnswer::Segment(const ModelView& target) {
  Stopwatch stopwatch;
  const bool by_sam = request_.sam_borders();
  SegmentOptions options = asked_.options;
  const BoxPrompt* const box = BoxIn(target);
  options.want_similarity = options.want_similarity || by_sam || box != nullptr;
  ASSIGN_OR_RETURN(auto results, model_.segmenter->Segment(query_, {&target, 1}, options));
  auto border_image = v1::SegmentViewsResponse::BORDER_IMAGE_UNSPECIFIED;
  if (by_sam) {
    const auto wanted = [this] { return !call_.given_up(); };
    ASSIGN_OR_RETURN(border_image, tools_.borders.Refine(model_, target, wanted, results.front()));
  }
  if (box != nullptr) response_->set_box_agreement(CutToBox(*box, results.front()));
  if (!asked_.options.want_similarity) results.front().similarity.clear();
  const SegmentResult result = frame_.Take(target, std::move(results.front()));
  compute_ += stopwatch.Lap();
  ASSIGN_OR_RETURN(*response_->add_masks(),
                   EncodeMask(target.name, result, request_.mask_encoding()));
  v1::SegmentViewsResponse::ViewMask& mask = *response_->mutable_masks()->rbegin();
  mask.set_border_image(border_image);
  response_->set_scale_quantile(result.scale);
  response_->set_scale_units(result.scale_units);
  response_->set_threshold(result.threshold);
  num_bytes_ += mask.ByteSizeLong();
  encode_ += stopwatch.Lap();
  return CheckAnswerSize(num_bytes_);
}

}  // namespace pepeseg
