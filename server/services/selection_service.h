#pragma once

#include "pepeseg/v1/selection_service.grpc.pb.h"
#include "server/rpc/call_runner.h"
#include "server/services/model_loader.h"
#include "server/services/selection_answer.h"
#include "server/services/selections.h"

namespace pepeseg {

// Answers calls about selections: on the pool `io` where only the store is read, else on `query`.
class SelectionServiceRpc final : public v1::SelectionService::CallbackService {
 public:
  // All must outlive it.
  SelectionServiceRpc(const CallRunner& runner, ModelLoader& models, Selections& selections)
      : runner_(runner), answers_(models, selections) {}

  grpc::ServerUnaryReactor* CreateSelection(grpc::CallbackServerContext* call,
                                            const v1::CreateSelectionRequest* request,
                                            v1::Selection* response) override;
  grpc::ServerUnaryReactor* CombineSelections(grpc::CallbackServerContext* call,
                                              const v1::CombineSelectionsRequest* request,
                                              v1::Selection* response) override;
  grpc::ServerUnaryReactor* UndoSelection(grpc::CallbackServerContext* call,
                                          const v1::UndoSelectionRequest* request,
                                          v1::Selection* response) override;
  grpc::ServerUnaryReactor* GetSelection(grpc::CallbackServerContext* call,
                                         const v1::GetSelectionRequest* request,
                                         v1::Selection* response) override;
  grpc::ServerUnaryReactor* ListSelections(grpc::CallbackServerContext* call,
                                           const v1::ListSelectionsRequest* request,
                                           v1::ListSelectionsResponse* response) override;
  grpc::ServerUnaryReactor* DeleteSelection(grpc::CallbackServerContext* call,
                                            const v1::DeleteSelectionRequest* request,
                                            google::protobuf::Empty* response) override;

 private:
  const CallRunner& runner_;
  const SelectionAnswers answers_;
};

}  // namespace pepeseg
