#include "server/services/selection_service.h"

#include <optional>
#include <string>

#include "absl/strings/str_cat.h"
#include "core/base/digest.h"
#include "core/base/status_macros.h"
#include "server/api/convert.h"
#include "server/api/decomposition.h"
#include "server/api/error.h"
#include "server/api/records_to_proto.h"
#include "server/api/segment_request.h"

namespace pepeseg {
namespace {

v1::SetOperation OrDefault(v1::SetOperation operation, v1::SetOperation by_default) {
  return operation == v1::SET_OPERATION_UNSPECIFIED ? by_default : operation;
}

// Returns `added` for REPLACE.
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

absl::Status CheckOperation(v1::SetOperation operation) {
  if (v1::SetOperation_IsValid(operation)) return absl::OkStatus();
  return BadField("operation", absl::StrCat(static_cast<int>(operation)), "no operation on sets");
}

absl::Status CheckCreate(const v1::CreateSelectionRequest& request) {
  RETURN_IF_ERROR(AtField(CheckNumVoting(request.num_views()), ""));
  RETURN_IF_ERROR(CheckOperation(request.operation()));
  if (OrDefault(request.operation(), v1::SET_OPERATION_REPLACE) != v1::SET_OPERATION_REPLACE &&
      request.base().empty()) {
    return BadField("base", "", "an operation needs a base");
  }
  return CheckRequestId(request.request_id());
}

// Sets request_id, and the digest by which a repeated request is recognised: of all other fields,
// and of the type, since requests of two types may have the same bytes.
template <typename Request>
void SetRequest(Request request, SelectionRecord* record) {
  record->request_id = request.request_id();
  request.clear_request_id();
  // The bytes of a serialised message are the same within one version of the program, which
  // suffices for retries.
  record->request_digest = Sha256Hex(request.GetTypeName() + "\n" + request.SerializeAsString());
}

}  // namespace

SelectionServiceRpc::SelectionServiceRpc(const CallRunner& runner, ModelLoader& models,
                                         Selections& selections)
    : runner_(runner), models_(models), selections_(selections) {}

absl::StatusOr<GaussianSet> SelectionServiceRpc::SelectPrompted(
    const UnaryCall& call, const ResidentModel& model,
    const v1::CreateSelectionRequest& request) const {
  const SegmentRequestReader reader(model->model(), model.id, models_.store());
  SelectRequest asked;
  ASSIGN_OR_RETURN(asked.prompt, reader.ReadPrompt(request.prompt(), request.frame()));
  ASSIGN_OR_RETURN(asked.granularity, reader.ReadGranularity(request.granularity(), "granularity"));
  if (request.num_views() != 0) asked.num_views = request.num_views();
  asked.keep_disconnected = request.keep_disconnected();
  return model->Select(asked, [&] { return call.CheckWanted(); });
}

absl::StatusOr<GaussianSet> SelectionServiceRpc::SelectSource(
    const UnaryCall& call, const ResidentModel& model,
    const v1::CreateSelectionRequest& request) const {
  switch (request.source_case()) {
    case v1::CreateSelectionRequest::kPrompt:
      return SelectPrompted(call, model, request);
    case v1::CreateSelectionRequest::kSegment:
      return FindSegment(*model, request.segment(), "segment");
    default:
      return BadField("prompt", "", "neither a prompt nor a segment");
  }
}

absl::Status SelectionServiceRpc::CreateSelection(const UnaryCall& call,
                                                  const v1::CreateSelectionRequest& request,
                                                  v1::Selection* response) const {
  // A repeated request is answered from its record before the model is loaded, even if "live" means
  // a newer model by now.
  ASSIGN_OR_RETURN(const SceneChild named, call.scenes().Model(request.model(), "model"));
  RETURN_IF_ERROR(CheckCreate(request));
  SelectionRecord record;
  record.scene = named.scene;
  SetRequest(request, &record);
  ASSIGN_OR_RETURN(const auto earlier, selections_.FindEarlier(record));
  if (earlier.has_value()) {
    *response = ToProto(*earlier);
    return absl::OkStatus();
  }
  ASSIGN_OR_RETURN(const ResidentModel model,
                   models_.LoadWithFeatures(call.scenes(), request.model(), "model"));
  RETURN_IF_ERROR(call.CheckWanted());
  GaussianSet base;
  if (!request.base().empty()) {
    ASSIGN_OR_RETURN(base, selections_.Find(call.scenes(), request.base(), model.id, "base"));
    ASSIGN_OR_RETURN(const SceneChild of,
                     call.scenes().Child(request.base(), "selections", "base"));
    record.base = of.number;
  }
  ASSIGN_OR_RETURN(const GaussianSet added, SelectSource(call, model, request));
  ASSIGN_OR_RETURN(const GaussianSet set,
                   Apply(OrDefault(request.operation(), v1::SET_OPERATION_REPLACE), base, added));
  ASSIGN_OR_RETURN(record, selections_.Record(model, set, record));
  *response = ToProto(record);
  return absl::OkStatus();
}

absl::Status SelectionServiceRpc::CombineSelections(const UnaryCall& call,
                                                    const v1::CombineSelectionsRequest& request,
                                                    v1::Selection* response) const {
  RETURN_IF_ERROR(CheckOperation(request.operation()));
  RETURN_IF_ERROR(CheckRequestId(request.request_id()));
  ASSIGN_OR_RETURN(const SceneChild first,
                   call.scenes().Child(request.first(), "selections", "first"));
  SelectionRecord record;
  record.scene = first.scene;
  record.base = first.number;
  SetRequest(request, &record);
  ASSIGN_OR_RETURN(const auto earlier, selections_.FindEarlier(record));
  if (earlier.has_value()) {
    *response = ToProto(*earlier);
    return absl::OkStatus();
  }
  ASSIGN_OR_RETURN(const SelectionRecord base, selections_.FindRecord(first));
  // Both sets must be of the model of `first`; Find refuses `second` otherwise.
  const SceneChild of = {base.scene, base.model};
  ASSIGN_OR_RETURN(const GaussianSet a,
                   selections_.Find(call.scenes(), request.first(), of, "first"));
  ASSIGN_OR_RETURN(const GaussianSet b,
                   selections_.Find(call.scenes(), request.second(), of, "second"));
  ASSIGN_OR_RETURN(const GaussianSet set,
                   Apply(OrDefault(request.operation(), v1::SET_OPERATION_UNION), a, b));
  // The model is loaded only for the bounds of the result, so a model without features does.
  ASSIGN_OR_RETURN(const ResidentModel model, models_.Load(of));
  ASSIGN_OR_RETURN(record, selections_.Record(model, set, record));
  *response = ToProto(record);
  return absl::OkStatus();
}

absl::Status SelectionServiceRpc::UndoSelection(const UnaryCall& call,
                                                const v1::UndoSelectionRequest& request,
                                                v1::Selection* response) const {
  ASSIGN_OR_RETURN(const SelectionRecord record,
                   selections_.FindRecord(call.scenes(), request.name(), "name"));
  if (record.base == 0) {
    return WithResource(absl::FailedPreconditionError(
                            absl::StrCat(request.name(), " was not made from another selection")),
                        "NO_BASE", request.name());
  }
  // NOT_FOUND if the base was deleted: selections refer to their base by number only.
  ASSIGN_OR_RETURN(const SelectionRecord base, selections_.FindRecord({record.scene, record.base}));
  *response = ToProto(base);
  return absl::OkStatus();
}

absl::Status SelectionServiceRpc::GetSelection(const UnaryCall& call,
                                               const v1::GetSelectionRequest& request,
                                               v1::Selection* response) const {
  ASSIGN_OR_RETURN(const SelectionRecord record,
                   selections_.FindRecord(call.scenes(), request.name(), "name"));
  *response = ToProto(record);
  return absl::OkStatus();
}

absl::Status SelectionServiceRpc::ListSelections(const UnaryCall& call,
                                                 const v1::ListSelectionsRequest& request,
                                                 v1::ListSelectionsResponse* response) const {
  ASSIGN_OR_RETURN(const SceneRef scene, call.scenes().Scene(request.parent(), "parent"));
  ASSIGN_OR_RETURN(const PageRequest page,
                   PageFromProto(request.page_size(), request.page_token()));
  ASSIGN_OR_RETURN(const Page<SelectionRecord> records,
                   models_.store().selections().ListSelections(scene, page));
  for (const SelectionRecord& record : records.records)
    *response->add_selections() = ToProto(record);
  response->set_next_page_token(records.next_page_token);
  return absl::OkStatus();
}

absl::Status SelectionServiceRpc::DeleteSelection(const UnaryCall& call,
                                                  const v1::DeleteSelectionRequest& request,
                                                  google::protobuf::Empty* /*response*/) const {
  ASSIGN_OR_RETURN(const SelectionRecord record,
                   selections_.FindRecord(call.scenes(), request.name(), "name"));
  return selections_.Delete(record);
}

}  // namespace pepeseg
