#include "server/services/segment_answer.h"

#include <spdlog/spdlog.h>

#include <utility>

#include "absl/memory/memory.h"
#include "absl/strings/str_cat.h"
#include "core/base/status_macros.h"
#include "server/api/convert.h"
#include "server/api/error.h"
#include "server/api/request_image.h"
#include "server/api/segment_request.h"
#include "server/rpc/call_runner.h"
#include "server/services/sam_choice.h"

namespace pepeseg {
namespace {

// Maximum number of views of a request that SAM answers. A view that SAM has not seen takes it one
// to two seconds of a core; nobody who has not asked for SAM waits for many of these.
constexpr size_t kMaxSamTargets = 100, kMaxNewTargets = 8;

absl::Status CheckSamTargets(size_t num_targets) {
  if (num_targets <= kMaxSamTargets) return absl::OkStatus();
  return BadField("targets", absl::StrCat(num_targets),
                  absl::StrCat("views; where SAM answers, a request may have ", kMaxSamTargets,
                               ": send several requests"));
}

}  // namespace

bool AsksSam(const v1::SegmentViewsRequest& request) {
  return request.sam_borders() || request.sam_clicks();
}

absl::StatusOr<std::unique_ptr<SegmentAnswer>> SegmentAnswer::Begin(
    const SegmentTools& tools, QueryCall call, const v1::SegmentViewsRequest& request,
    v1::SegmentViewsResponse* response) {
  if (AsksSam(request)) RETURN_IF_ERROR(tools.images.CheckAvailable());
  if (request.sam_clicks()) {
    RETURN_IF_ERROR(CheckForSam(request.prompt(), request.granularity()));
  }
  auto answer = absl::WrapUnique(new SegmentAnswer(request, response));
  Stopwatch stopwatch;
  ASSIGN_OR_RETURN(answer->model_,
                   tools.models.LoadWithFeatures(call.scenes, request.model(), "model"));
  *response->mutable_timing()->mutable_queue() = ToProto(call.queued);
  const ResidentModel& model = answer->model_;
  *response->mutable_timing()->mutable_load() = ToProto(stopwatch.Lap());
  const SegmentRequestReader reader(model->model(), model.id, tools.store);
  ASSIGN_OR_RETURN(answer->asked_, reader.Read(request));
  answer->check_ = std::move(call.check);
  RETURN_IF_ERROR(answer->ChooseSam(tools));
  answer->compute_ = stopwatch.Lap();
  return answer;
}

absl::Status SegmentAnswer::ChooseSam(const SegmentTools& tools) {
  if (model_.snapshot) return CheckAsksNoSam();
  const bool suits = SuitsSam(model_->model(), tools.images);
  const absl::Status few = CheckSamTargets(asked_.targets.size());
  const bool are_few = few.ok() && (asked_.targets.size() <= kMaxNewTargets ||
                                    tools.images.HasKept(model_, asked_.targets.back()));
  asked_.image_clicks = AnswersBySam(request_, model_->model(), tools.images);
  asked_.image_borders = request_.has_sam_borders()
                             ? request_.sam_borders()
                             : suits && are_few && asked_.options.refine_borders;
  if (!asked_.image_clicks && !asked_.image_borders) return absl::OkStatus();
  is_sam_needed_ = AsksSam(request_);
  if (is_sam_needed_) RETURN_IF_ERROR(few);
  images_ = tools.images.SegmenterOf(model_);
  asked_.images = images_.get();
  asked_.images_of_prompted_view_only = !is_sam_needed_ && !are_few;
  return absl::OkStatus();
}

// The training keeps what SAM sees in the photographs at its end.
absl::Status SegmentAnswer::CheckAsksNoSam() const {
  if (!AsksSam(request_)) return absl::OkStatus();
  return WithResource(
      absl::FailedPreconditionError(absl::StrCat(
          model_.name, " is still training: leave sam_borders and sam_clicks out until it ends")),
      "NO_SAM", model_.name);
}

// Where nobody asked for SAM, an answer without it is better than none.
bool SegmentAnswer::LeaveSam(const absl::Status& status) {
  if (!asks_sam() || is_sam_needed_ || !IsSamsFault(status)) return false;
  spdlog::warn("SAM does not answer: {}", status.ToString());
  asked_.image_clicks = asked_.image_borders = false;
  return true;
}

absl::Status SegmentAnswer::BeginViews() {
  auto begun = model_->Segment(asked_, check_);
  if (LeaveSam(begun.status())) begun = model_->Segment(asked_, check_);
  RETURN_IF_ERROR(begun.status());
  views_ = *std::move(begun);
  return absl::OkStatus();
}

std::optional<absl::Status> SegmentAnswer::SegmentNext() {
  Stopwatch stopwatch;
  if (!views_) RETURN_IF_ERROR(BeginViews());
  auto next = views_->Next();
  if (LeaveSam(next.status())) {
    views_->LeaveImages();
    next = views_->Next();
  }
  ASSIGN_OR_RETURN(const SegmentResult result, std::move(next));
  compute_ += stopwatch.Lap();
  if (result.box_agreement) response_->set_box_agreement(*result.box_agreement);
  response_->set_scale_quantile(result.scale);
  response_->set_scale_units(result.scale_units);
  response_->set_threshold(result.threshold);
  v1::SegmentViewsResponse::ViewMask& mask = *response_->add_masks();
  ASSIGN_OR_RETURN(mask, EncodeMask(result, request_.mask_encoding()));
  num_bytes_ += mask.ByteSizeLong();
  encode_ += stopwatch.Lap();
  // The size of the answer is checked before the next view is computed.
  RETURN_IF_ERROR(CheckAnswerSize(num_bytes_));
  if (!views_->done()) return std::nullopt;
  *response_->mutable_timing()->mutable_compute() = ToProto(compute_);
  *response_->mutable_timing()->mutable_encode() = ToProto(encode_);
  SetModel(model_, response_);
  return absl::OkStatus();
}

}  // namespace pepeseg
