#include "server/services/selection_answer.h"

#include <string>
#include <system_error>

#include "absl/strings/str_cat.h"
#include "core/base/status_macros.h"
#include "core/prompt/resolve_prompt.h"
#include "core/select/gaussian_sets.h"
#include "core/select/select_gaussians.h"
#include "server/api/error.h"
#include "server/api/resource_name.h"
#include "server/api/rows_to_proto.h"
#include "server/services/model_lookup.h"
#include "server/services/read_prompt.h"
#include "server/services/segment_lookup.h"
#include "server/services/selection_lookup.h"
#include "server/services/selection_record.h"

namespace pepeseg {
namespace {

constexpr int kMaxVotingViews = 100;

absl::StatusOr<GaussianSet> Apply(v1::SetOperation operation, const GaussianSet& base,
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

absl::Status CheckOperation(v1::SetOperation operation, bool may_be_none) {
  const bool none = operation == v1::SET_OPERATION_UNSPECIFIED;
  if (v1::SetOperation_IsValid(operation) && (!none || may_be_none)) return absl::OkStatus();
  return BadField("operation", absl::StrCat(static_cast<int>(operation)), "no operation on sets");
}

absl::Status CheckSelect(const v1::SelectRequest& request) {
  if (request.num_views() < 0 || request.num_views() > kMaxVotingViews) {
    return BadField("num_views", absl::StrCat(request.num_views()),
                    absl::StrCat("not in [0, ", kMaxVotingViews, "]"));
  }
  RETURN_IF_ERROR(CheckOperation(request.operation(), true));
  if (request.operation() != v1::SET_OPERATION_UNSPECIFIED && request.base().empty()) {
    return BadField("base", "", "an operation needs a base");
  }
  return CheckRequestId(request.request_id());
}

absl::StatusOr<GaussianSet> SelectPrompted(const UnaryCall& call, const ServiceContext& context,
                                           const ResidentModel& model,
                                           const v1::SelectRequest& request) {
  const Model& of = model.segmenter->model();
  SelectTask task;
  ASSIGN_OR_RETURN(task.prompt, ReadPrompt(context, model, request.prompt(), request.frame()));
  ASSIGN_OR_RETURN(const Granularity granularity,
                   ReadGranularity(request.granularity(), of, "granularity"));
  ASSIGN_OR_RETURN(task.query, ResolvePrompt(*model.segmenter, task.prompt, granularity));
  if (request.num_views() != 0) task.num_views = request.num_views();
  task.keep_disconnected = request.keep_disconnected();
  return SelectGaussians(*model.segmenter, task, [&] { return call.CheckWanted(); });
}

absl::StatusOr<GaussianSet> SelectSource(const UnaryCall& call, const ServiceContext& context,
                                         const ResidentModel& model,
                                         const v1::SelectRequest& request) {
  switch (request.source_case()) {
    case v1::SelectRequest::kPrompt:
      return SelectPrompted(call, context, model, request);
    case v1::SelectRequest::kSegment:
      return FindSegment(*model.segmenter, request.segment(), "segment");
    default:
      return BadField("prompt", "", "neither a prompt nor a segment");
  }
}

}  // namespace

absl::Status AnswerSelect(const UnaryCall& call, const ServiceContext& context,
                          const v1::SelectRequest& request, v1::Selection* response) {
  ASSIGN_OR_RETURN(const SceneChild named, ParseModelName(request.model(), "model"));
  RETURN_IF_ERROR(CheckSelect(request));
  SelectionRow row;
  row.scene = named.scene;
  SetRequest(request, &row);
  ASSIGN_OR_RETURN(const auto earlier, FindEarlier(context, row));
  if (earlier.has_value()) {
    *response = ToProto(*earlier);
    return absl::OkStatus();
  }
  ASSIGN_OR_RETURN(const ResidentModel model,
                   LoadModelWithFeatures(context, request.model(), "model"));
  RETURN_IF_ERROR(call.CheckWanted());
  GaussianSet base;
  if (!request.base().empty()) {
    ASSIGN_OR_RETURN(base, FindSelection(context, request.base(), model.row, "base"));
    ASSIGN_OR_RETURN(const SceneChild of, ParseChildName(request.base(), "selections", "base"));
    row.base = of.number;
  }
  ASSIGN_OR_RETURN(const GaussianSet added, SelectSource(call, context, model, request));
  ASSIGN_OR_RETURN(const GaussianSet set, Apply(request.operation(), base, added));
  ASSIGN_OR_RETURN(row, RecordSelection(context, model, set, row));
  *response = ToProto(row);
  return absl::OkStatus();
}

absl::Status AnswerCombineSelections(const ServiceContext& context,
                                     const v1::CombineSelectionsRequest& request,
                                     v1::Selection* response) {
  RETURN_IF_ERROR(CheckOperation(request.operation(), false));
  RETURN_IF_ERROR(CheckRequestId(request.request_id()));
  ASSIGN_OR_RETURN(const SceneChild first, ParseChildName(request.first(), "selections", "first"));
  SelectionRow row;
  row.scene = first.scene;
  row.base = first.number;
  SetRequest(request, &row);
  ASSIGN_OR_RETURN(const auto earlier, FindEarlier(context, row));
  if (earlier.has_value()) {
    *response = ToProto(*earlier);
    return absl::OkStatus();
  }
  ASSIGN_OR_RETURN(const SelectionRow base, FindSelectionRow(context, request.first(), "first"));
  const SceneChild of = {base.scene, base.model};
  ASSIGN_OR_RETURN(const GaussianSet a, FindSelection(context, request.first(), of, "first"));
  ASSIGN_OR_RETURN(const GaussianSet b, FindSelection(context, request.second(), of, "second"));
  ASSIGN_OR_RETURN(const GaussianSet set, Apply(request.operation(), a, b));
  ASSIGN_OR_RETURN(const ResidentModel model,
                   LoadModel(context, KeyedChildName(of.scene, "models", of.number), "first"));
  ASSIGN_OR_RETURN(row, RecordSelection(context, model, set, row));
  *response = ToProto(row);
  return absl::OkStatus();
}

absl::Status AnswerUndoSelection(const ServiceContext& context,
                                 const v1::UndoSelectionRequest& request, v1::Selection* response) {
  ASSIGN_OR_RETURN(const SelectionRow row, FindSelectionRow(context, request.name(), "name"));
  if (row.base == 0) {
    return WithResource(absl::FailedPreconditionError(
                            absl::StrCat(request.name(), " was not made from another selection")),
                        "NO_BASE", request.name());
  }
  const std::string base_name = KeyedChildName(row.scene, "selections", row.base);
  ASSIGN_OR_RETURN(const SelectionRow base, FindSelectionRow(context, base_name, "name"));
  *response = ToProto(base);
  return absl::OkStatus();
}

absl::Status AnswerGetSelection(const ServiceContext& context,
                                const v1::GetSelectionRequest& request, v1::Selection* response) {
  ASSIGN_OR_RETURN(const SelectionRow row, FindSelectionRow(context, request.name(), "name"));
  *response = ToProto(row);
  return absl::OkStatus();
}

absl::Status AnswerListSelections(const ServiceContext& context,
                                  const v1::ListSelectionsRequest& request,
                                  v1::ListSelectionsResponse* response) {
  ASSIGN_OR_RETURN(const std::string scene, ParseSceneName(request.parent(), "parent"));
  ASSIGN_OR_RETURN(const PageRequest page,
                   PageFromProto(request.page_size(), request.page_token()));
  ASSIGN_OR_RETURN(const Page<SelectionRow> rows,
                   context.store->selections().ListSelections(scene, page));
  for (const SelectionRow& row : rows.rows) *response->add_selections() = ToProto(row);
  response->set_next_page_token(rows.next_page_token);
  return absl::OkStatus();
}

absl::Status AnswerDeleteSelection(const ServiceContext& context,
                                   const v1::DeleteSelectionRequest& request) {
  ASSIGN_OR_RETURN(const SelectionRow row, FindSelectionRow(context, request.name(), "name"));
  RETURN_IF_ERROR(context.store->selections().DeleteSelection(row.scene, row.number));
  // The selection is gone already: a file that cannot be removed only costs space.
  std::error_code ignored;
  std::filesystem::remove(context.data_folder / row.file, ignored);
  return absl::OkStatus();
}

}  // namespace pepeseg
