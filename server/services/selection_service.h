#pragma once

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "pepeseg/v1/selection_service.grpc.pb.h"
#include "server/rpc/call_runner.h"
#include "server/services/model_loader.h"
#include "server/services/selections.h"

namespace pepeseg {

// Answers calls about selections: on the pool `io` where only the store is read, else, as for
// Create and Combine, which load a model and compute, on `query`.
class SelectionServiceRpc final : public v1::SelectionService::CallbackService {
 public:
  // All must outlive it.
  SelectionServiceRpc(const CallRunner& runner, ModelLoader& models, Selections& selections);

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
  // Answer the calls. All of them block.
  absl::Status Create(const UnaryCall& call, const v1::CreateSelectionRequest& request,
                      v1::Selection* response) const;
  absl::Status Combine(const UnaryCall& call, const v1::CombineSelectionsRequest& request,
                       v1::Selection* response) const;
  absl::Status Undo(const UnaryCall& call, const v1::UndoSelectionRequest& request,
                    v1::Selection* response) const;
  absl::Status Get(const UnaryCall& call, const v1::GetSelectionRequest& request,
                   v1::Selection* response) const;
  absl::Status List(const UnaryCall& call, const v1::ListSelectionsRequest& request,
                    v1::ListSelectionsResponse* response) const;
  absl::Status Delete(const UnaryCall& call, const v1::DeleteSelectionRequest& request) const;
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
