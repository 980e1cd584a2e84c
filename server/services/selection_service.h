#pragma once

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "pepeseg/v1/selection_service.grpc.pb.h"
#include "server/rpc/call_runner.h"
#include "server/services/model_loader.h"
#include "server/services/selections.h"

namespace pepeseg {

// Answers calls about selections.
class SelectionServiceRpc final : public v1::SelectionService::CallbackService {
 public:
  // All must outlive it.
  SelectionServiceRpc(const CallRunner& runner, ModelLoader& models, Selections& selections);

  PEPESEG_UNARY(CreateSelection, v1::CreateSelectionRequest, v1::Selection)
  PEPESEG_UNARY(CombineSelections, v1::CombineSelectionsRequest, v1::Selection)
  PEPESEG_UNARY(UndoSelection, v1::UndoSelectionRequest, v1::Selection)
  PEPESEG_UNARY(GetSelection, v1::GetSelectionRequest, v1::Selection)
  PEPESEG_UNARY(ListSelections, v1::ListSelectionsRequest, v1::ListSelectionsResponse)
  PEPESEG_UNARY(DeleteSelection, v1::DeleteSelectionRequest, google::protobuf::Empty)

 private:
  // Return the Gaussians that a request selects, by a prompt or as a segment.
  absl::StatusOr<GaussianSet> SelectPrompted(const UnaryCall& call, const ResidentModel& model,
                                             const v1::CreateSelectionRequest& request) const;
  absl::StatusOr<GaussianSet> SelectSource(const UnaryCall& call, const ResidentModel& model,
                                           const v1::CreateSelectionRequest& request) const;

  const CallRunner& runner_;
  ModelLoader& models_;
  Selections& selections_;
};

}  // namespace pepeseg
