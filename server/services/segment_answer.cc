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

namespace pepeseg {
namespace {

// Maximum number of views of a request that SAM answers. A view that SAM has not seen takes it one
// to two seconds of a core.
constexpr size_t kMaxSamTargets = 100;

absl::Status CheckSamTargets(size_t num_targets) {
  if (num_targets <= kMaxSamTargets) return absl::OkStatus();
  return BadField("targets", absl::StrCat(num_targets),
                  absl::StrCat("views; where SAM answers, a request may have ", kMaxSamTargets,
                               ": send several requests"));
}

// SAM answers points alone, and chooses by itself how large the thing is.
bool AreClicks(const v1::SegmentViewsRequest& request) {
  const v1::Granularity& granularity = request.granularity();
  return request.prompt().has_points() && !granularity.has_threshold() &&
         granularity.scale_case() == v1::Granularity::SCALE_NOT_SET;
}

absl::Status CheckSamClicks(const v1::SegmentViewsRequest& request) {
  if (!request.sam_clicks() || AreClicks(request)) return absl::OkStatus();
  return BadField("sam_clicks", "true", "is for points, without scale and threshold");
}

// A training with SAM has kept what SAM's decoder needs of each photograph, and a field that has
// learnt SAM's masks gains by SAM: tests/bench/results/sam_clicks.md.
bool WasTrainedBySam(const Model& model) {
  const auto masks = model.facts.find("masks");
  return masks != model.facts.end() &&
         (masks->second == "sam" || masks->second == "sam and embedded");
}

}  // namespace

bool AsksSam(const v1::SegmentViewsRequest& request) {
  return request.sam_borders() || request.sam_clicks();
}

absl::StatusOr<std::unique_ptr<SegmentAnswer>> SegmentAnswer::Begin(
    const SegmentTools& tools, QueryCall call, const v1::SegmentViewsRequest& request,
    v1::SegmentViewsResponse* response) {
  if (AsksSam(request)) RETURN_IF_ERROR(tools.images.CheckAvailable());
  RETURN_IF_ERROR(CheckSamClicks(request));
  auto answer = absl::WrapUnique(new SegmentAnswer(request, response));
  Stopwatch stopwatch;
  ASSIGN_OR_RETURN(answer->model_,
                   tools.models.LoadWithFeatures(call.scenes, request.model(), "model"));
  *response->mutable_timing()->mutable_queue() = ToProto(call.queued);
  const ResidentModel& model = answer->model_;
  *response->mutable_timing()->mutable_load() = ToProto(stopwatch.Lap());
  const SegmentRequestReader reader(model->model(), model.id, tools.models.store());
  ASSIGN_OR_RETURN(answer->asked_, reader.Read(request));
  answer->check_ = std::move(call.check);
  RETURN_IF_ERROR(answer->ChooseSam(tools));
  answer->compute_ = stopwatch.Lap();
  return answer;
}

absl::Status SegmentAnswer::ChooseSam(const SegmentTools& tools) {
  const bool is_default = !request_.has_sam_clicks() && AreClicks(request_) &&
                          tools.images.CheckAvailable().ok() && WasTrainedBySam(model_->model());
  if (!AsksSam(request_) && !is_default) return absl::OkStatus();
  const absl::Status few = CheckSamTargets(asked_.targets.size());
  if (AsksSam(request_)) RETURN_IF_ERROR(few);
  images_ = tools.images.SegmenterOf(model_);
  asked_.images = images_.get();
  asked_.image_borders = request_.sam_borders();
  asked_.image_clicks = request_.sam_clicks() || is_default;
  is_sam_needed_ = AsksSam(request_);
  asked_.images_of_clicked_view_only = !few.ok();
  return absl::OkStatus();
}

// Where nobody asked for SAM, an answer without it is better than none.
absl::Status SegmentAnswer::BeginViews() {
  auto begun = model_->Segment(asked_, check_);
  const bool is_sams_fault = absl::IsFailedPrecondition(begun.status()) ||
                             absl::IsResourceExhausted(begun.status()) ||
                             absl::IsUnavailable(begun.status());
  if (asks_sam() && !is_sam_needed_ && is_sams_fault) {
    spdlog::warn("SAM does not answer clicks: {}", begun.status().ToString());
    asked_.image_clicks = false;
    begun = model_->Segment(asked_, check_);
  }
  RETURN_IF_ERROR(begun.status());
  views_ = *std::move(begun);
  return absl::OkStatus();
}

std::optional<absl::Status> SegmentAnswer::SegmentNext() {
  Stopwatch stopwatch;
  if (!views_) RETURN_IF_ERROR(BeginViews());
  ASSIGN_OR_RETURN(const SegmentResult result, views_->Next());
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
  response_->set_model(model_.name);
  return absl::OkStatus();
}

}  // namespace pepeseg
