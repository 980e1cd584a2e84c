#include "server/services/selection_service.h"

#include <memory>
#include <optional>
#include <utility>

#include "absl/strings/str_cat.h"
#include "core/base/status_macros.h"
#include "server/api/convert.h"
#include "server/api/error.h"
#include "server/api/gaussian_bits.h"
#include "server/api/records_to_proto.h"
#include "server/services/new_selection.h"

namespace pepeseg {
namespace {

// Bound of GetSelection's Gaussians: their bits are within kAnswerBytes.
constexpr int64_t kMaxGaussiansInAnswer = 30'000'000;
static_assert(kMaxGaussiansInAnswer / 8 < static_cast<int64_t>(kAnswerBytes) - (64 << 10));

// Returns RESOURCE_EXHAUSTED for a model whose bits do not fit into an answer.
absl::Status CheckBitsFit(const SelectionRecord& record) {
  if (record.model_gaussians <= kMaxGaussiansInAnswer) return absl::OkStatus();
  return absl::ResourceExhaustedError(absl::StrCat(
      "want_gaussians: the model has ", record.model_gaussians, " Gaussians; the bits of at most ",
      kMaxGaussiansInAnswer, " fit into an answer"));
}

}  // namespace

SelectionServiceRpc::SelectionServiceRpc(const CallRunner& runner, ModelLoader& models,
                                         ViewImages& images, Selections& selections)
    : runner_(runner), models_(models), images_(images), selections_(selections) {}

grpc::ServerUnaryReactor* SelectionServiceRpc::CreateSelection(
    grpc::CallbackServerContext* call, const v1::CreateSelectionRequest* request,
    v1::Selection* response) {
  // Whether SAM helps, for which the call waits on `border`, is known when the model is.
  return runner_.RunInParts(
      runner_.pools().query, {call, request},
      [this, request, response](const UnaryCall& unary) -> absl::StatusOr<AnswerParts> {
        ASSIGN_OR_RETURN(std::shared_ptr<NewSelection> made,
                         NewSelection::Begin({models_, images_, selections_}, unary, *request));
        WorkerPool* const rest = made->asks_sam() ? &runner_.pools().border : nullptr;
        return AnswerParts{[made = std::move(made), response]() -> std::optional<absl::Status> {
                             return made->Make(response);
                           },
                           rest};
      });
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
  SetRequest(request, record);
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
                   Combine(OperationOr(request.operation(), v1::SET_OPERATION_UNION), a, b));
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
  if (!request.want_gaussians()) return absl::OkStatus();
  RETURN_IF_ERROR(CheckBitsFit(record));
  ASSIGN_OR_RETURN(const GaussianSet set, selections_.Read(record));
  *response->mutable_gaussians() = ToProto(set);
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
