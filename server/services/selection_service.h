#pragma once

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "pepeseg/v1/selection_service.grpc.pb.h"
#include "server/rpc/call_runner.h"
#include "server/services/model_loader.h"
#include "server/services/selections.h"
#include "server/services/view_images.h"

namespace pepeseg {

// Answers calls about selections.
class SelectionServiceRpc final : public v1::SelectionService::CallbackService {
 public:
  // All must outlive it.
  SelectionServiceRpc(const CallRunner& runner, ModelLoader& models, ViewImages& images,
                      Selections& selections);

  grpc::ServerUnaryReactor* CreateSelection(grpc::CallbackServerContext* call,
                                            const v1::CreateSelectionRequest* request,
                                            v1::Selection* response) override;
  PEPESEG_UNARY(CombineSelections, v1::CombineSelectionsRequest, v1::Selection)
  PEPESEG_UNARY(UndoSelection, v1::UndoSelectionRequest, v1::Selection)
  PEPESEG_UNARY(GetSelection, v1::GetSelectionRequest, v1::Selection)
  PEPESEG_UNARY(ListSelections, v1::ListSelectionsRequest, v1::ListSelectionsResponse)
  PEPESEG_UNARY(DeleteSelection, v1::DeleteSelectionRequest, google::protobuf::Empty)

 private:
  const CallRunner& runner_;
  ModelLoader& models_;
  ViewImages& images_;
  Selections& selections_;
};

}  // namespace pepeseg
