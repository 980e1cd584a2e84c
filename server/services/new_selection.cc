#include "server/services/new_selection.h"

#include <spdlog/spdlog.h>

#include <utility>

#include "absl/memory/memory.h"
#include "absl/strings/str_cat.h"
#include "core/base/status_macros.h"
#include "server/api/convert.h"
#include "server/api/decomposition.h"
#include "server/api/error.h"
#include "server/api/gaussian_bits.h"
#include "server/api/records_to_proto.h"
#include "server/api/segment_request.h"
#include "server/services/sam_choice.h"

namespace pepeseg {
namespace {

constexpr size_t kMaxDisplayNameBytes = 256;

absl::Status CheckCreate(const v1::CreateSelectionRequest& request) {
  RETURN_IF_ERROR(AtField(CheckNumVoting(request.num_views()), ""));
  RETURN_IF_ERROR(CheckOperation(request.operation()));
  if (OperationOr(request.operation(), v1::SET_OPERATION_REPLACE) != v1::SET_OPERATION_REPLACE &&
      request.base().empty()) {
    return BadField("base", "", "an operation needs a base");
  }
  if (request.display_name().size() > kMaxDisplayNameBytes) {
    return BadField("display_name", absl::StrCat(request.display_name().size()),
                    absl::StrCat("bytes; allowed are ", kMaxDisplayNameBytes));
  }
  return CheckRequestId(request.request_id());
}

}  // namespace

v1::SetOperation OperationOr(v1::SetOperation operation, v1::SetOperation by_default) {
  return operation == v1::SET_OPERATION_UNSPECIFIED ? by_default : operation;
}

absl::Status CheckOperation(v1::SetOperation operation) {
  if (v1::SetOperation_IsValid(operation)) return absl::OkStatus();
  return BadField("operation", absl::StrCat(static_cast<int>(operation)), "no operation on sets");
}

absl::StatusOr<GaussianSet> Combine(v1::SetOperation operation, const GaussianSet& base,
                                    const GaussianSet& added) {
  switch (operation) {
    case v1::SET_OPERATION_UNION:
      return Union(base, added);
    case v1::SET_OPERATION_SUBTRACT:
      return Subtract(base, added);
    case v1::SET_OPERATION_INTERSECT:
      return Intersect(base, added);
    default:
      return added;
  }
}

absl::StatusOr<std::unique_ptr<NewSelection>> NewSelection::Begin(
    const SelectionTools& tools, const UnaryCall& call, const v1::CreateSelectionRequest& request) {
  ASSIGN_OR_RETURN(const SceneChild named, call.scenes().Model(request.model(), "model"));
  RETURN_IF_ERROR(CheckCreate(request));
  auto made = absl::WrapUnique(new NewSelection(tools, call, request));
  made->record_.scene = named.scene;
  made->record_.display_name = request.display_name();
  SetRequest(request, made->record_);
  ASSIGN_OR_RETURN(auto earlier, tools.selections.FindEarlier(made->record_));
  made->is_earlier_ = earlier.has_value();
  if (earlier) {
    made->record_ = *std::move(earlier);
    return made;
  }
  // Given Gaussians need no features.
  ASSIGN_OR_RETURN(made->model_,
                   request.has_gaussians()
                       ? tools.models.Load(call.scenes(), request.model(), "model")
                       : tools.models.LoadWithFeatures(call.scenes(), request.model(), "model"));
  RETURN_IF_ERROR(call.CheckWanted());
  RETURN_IF_ERROR(made->Read(call.scenes()));
  return made;
}

absl::Status NewSelection::Read(const NamedScenes& scenes) {
  if (!request_.base().empty()) {
    ASSIGN_OR_RETURN(base_, tools_.selections.Find(scenes, request_.base(), model_.id, "base"));
    ASSIGN_OR_RETURN(const SceneChild of, scenes.Child(request_.base(), "selections", "base"));
    record_.base = of.number;
  }
  return request_.has_prompt() ? ReadPrompt() : absl::OkStatus();
}

absl::Status NewSelection::ReadPrompt() {
  const SegmentRequestReader reader(model_->model(), model_.id, tools_.models.store());
  ASSIGN_OR_RETURN(asked_.prompt, reader.ReadPrompt(request_.prompt(), request_.frame()));
  ASSIGN_OR_RETURN(asked_.granularity,
                   reader.ReadGranularity(request_.granularity(), "granularity"));
  if (request_.num_views() != 0) asked_.num_views = request_.num_views();
  asked_.keep_disconnected = request_.keep_disconnected();
  if (request_.sam_clicks()) {
    RETURN_IF_ERROR(tools_.images.CheckAvailable("leave sam_clicks out"));
    RETURN_IF_ERROR(CheckForSam(request_.prompt(), request_.granularity()));
  }
  if (AnswersBySam(request_, model_->model(), tools_.images)) {
    images_ = tools_.images.SegmenterOf(model_);
  }
  asked_.images = images_.get();
  return absl::OkStatus();
}

absl::StatusOr<GaussianSet> NewSelection::Select() {
  if (request_.has_segment()) return FindSegment(*model_, request_.segment(), "segment");
  if (request_.has_gaussians()) {
    return SetFromProto(request_.gaussians(), model_->model().gaussians.count, "gaussians.bits");
  }
  if (!request_.has_prompt()) {
    return BadField("prompt", "", "is missing, and so are a segment and Gaussians");
  }
  const auto check = [this] { return call_.CheckWanted(); };
  auto set = model_->Select(asked_, check);
  // Where nobody asked for SAM, a selection without it is better than none.
  if (asks_sam() && !request_.sam_clicks() && IsSamsFault(set.status())) {
    spdlog::warn("SAM does not answer: {}", set.status().ToString());
    asked_.images = nullptr;
    set = model_->Select(asked_, check);
  }
  return set;
}

absl::Status NewSelection::Make(v1::Selection* response) {
  if (!is_earlier_) {
    ASSIGN_OR_RETURN(const GaussianSet added, Select());
    ASSIGN_OR_RETURN(
        const GaussianSet set,
        Combine(OperationOr(request_.operation(), v1::SET_OPERATION_REPLACE), base_, added));
    ASSIGN_OR_RETURN(record_, tools_.selections.Record(model_, set, record_));
  }
  *response = ToProto(record_);
  return absl::OkStatus();
}

}  // namespace pepeseg
