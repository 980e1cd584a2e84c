#include "server/services/segment_answer.h"

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
absl::Status CheckSamClicks(const v1::SegmentViewsRequest& request) {
  const v1::Granularity& granularity = request.granularity();
  const bool chosen =
      granularity.has_threshold() || granularity.scale_case() != v1::Granularity::SCALE_NOT_SET;
  if (request.prompt().has_points() && !chosen) {
    return absl::OkStatus();
  }
  return BadField("sam_clicks", "true", "is for points, without scale and threshold");
}

}  // namespace

bool AsksSam(const v1::SegmentViewsRequest& request) {
  return request.sam_borders() || request.sam_clicks();
}

absl::StatusOr<std::unique_ptr<SegmentAnswer>> SegmentAnswer::Begin(
    const SegmentTools& tools, QueryCall call, const v1::SegmentViewsRequest& request,
    v1::SegmentViewsResponse* response) {
  if (AsksSam(request)) RETURN_IF_ERROR(tools.images.CheckAvailable());
  if (request.sam_clicks()) RETURN_IF_ERROR(CheckSamClicks(request));
  auto answer = absl::WrapUnique(new SegmentAnswer(request, response));
  Stopwatch stopwatch;
  ASSIGN_OR_RETURN(answer->model_,
                   tools.models.LoadWithFeatures(call.scenes, request.model(), "model"));
  *response->mutable_timing()->mutable_queue() = ToProto(call.queued);
  const ResidentModel& model = answer->model_;
  *response->mutable_timing()->mutable_load() = ToProto(stopwatch.Lap());
  const SegmentRequestReader reader(model->model(), model.id, tools.models.store());
  ASSIGN_OR_RETURN(SegmentRequest asked, reader.Read(request));
  if (AsksSam(request)) {
    RETURN_IF_ERROR(CheckSamTargets(asked.targets.size()));
    answer->images_ = tools.images.SegmenterOf(model);
    asked.images = answer->images_.get();
    asked.image_borders = request.sam_borders();
    asked.image_clicks = request.sam_clicks();
  }
  ASSIGN_OR_RETURN(answer->views_, model->Segment(std::move(asked), std::move(call.check)));
  answer->compute_ = stopwatch.Lap();
  return answer;
}

std::optional<absl::Status> SegmentAnswer::SegmentNext() {
  Stopwatch stopwatch;
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
