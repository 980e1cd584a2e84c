#pragma once

#include <string>

#include "pepeseg/v1/admin_service.grpc.pb.h"
#include "server/rpc/call_runner.h"
#include "server/services/model_loader.h"
#include "server/services/operations.h"
#include "server/services/project_answers.h"

namespace pepeseg {

// Answers the calls of operators: models in memory, keys and quotas of projects, the server's
// state.
class AdminServiceRpc final : public v1::AdminService::CallbackService {
 public:
  // `pool` runs the calls of this service. Both must outlive it.
  AdminServiceRpc(Operations& operations, WorkerPool& pool);

  grpc::ServerUnaryReactor* LoadModel(grpc::CallbackServerContext* call,
                                      const v1::LoadModelRequest* request,
                                      v1::ResidentModel* response) override;
  grpc::ServerUnaryReactor* UnloadModel(grpc::CallbackServerContext* call,
                                        const v1::UnloadModelRequest* request,
                                        google::protobuf::Empty* response) override;
  grpc::ServerUnaryReactor* PinModel(grpc::CallbackServerContext* call,
                                     const v1::PinModelRequest* request,
                                     v1::ResidentModel* response) override;
  grpc::ServerUnaryReactor* UnpinModel(grpc::CallbackServerContext* call,
                                       const v1::UnpinModelRequest* request,
                                       v1::ResidentModel* response) override;
  grpc::ServerUnaryReactor* ListResidentModels(grpc::CallbackServerContext* call,
                                               const v1::ListResidentModelsRequest* request,
                                               v1::ListResidentModelsResponse* response) override;
  grpc::ServerUnaryReactor* CreateKey(grpc::CallbackServerContext* call,
                                      const v1::CreateKeyRequest* request,
                                      v1::CreateKeyResponse* response) override;
  grpc::ServerUnaryReactor* GetKey(grpc::CallbackServerContext* call,
                                   const v1::GetKeyRequest* request, v1::ApiKey* response) override;
  grpc::ServerUnaryReactor* ListKeys(grpc::CallbackServerContext* call,
                                     const v1::ListKeysRequest* request,
                                     v1::ListKeysResponse* response) override;
  grpc::ServerUnaryReactor* RevokeKey(grpc::CallbackServerContext* call,
                                      const v1::RevokeKeyRequest* request,
                                      v1::ApiKey* response) override;
  grpc::ServerUnaryReactor* GetProjectUsage(grpc::CallbackServerContext* call,
                                            const v1::GetProjectUsageRequest* request,
                                            v1::ProjectUsage* response) override;
  grpc::ServerUnaryReactor* UpdateQuota(grpc::CallbackServerContext* call,
                                        const v1::UpdateQuotaRequest* request,
                                        v1::ProjectUsage* response) override;
  grpc::ServerUnaryReactor* GetServerStatus(grpc::CallbackServerContext* call,
                                            const v1::GetServerStatusRequest* request,
                                            v1::ServerStatus* response) override;
  grpc::ServerUnaryReactor* DrainServer(grpc::CallbackServerContext* call,
                                        const v1::DrainServerRequest* request,
                                        v1::ServerStatus* response) override;
  grpc::ServerUnaryReactor* ResumeServer(grpc::CallbackServerContext* call,
                                         const v1::ResumeServerRequest* request,
                                         v1::ServerStatus* response) override;

 private:
  absl::Status Load(const v1::LoadModelRequest& request, v1::ResidentModel* response);
  absl::Status Pin(const v1::PinModelRequest& request, v1::ResidentModel* response);
  absl::Status Unpin(const v1::UnpinModelRequest& request, v1::ResidentModel* response);
  // Pins or unpins a model that is in memory, and describes it. NOT_FOUND: it is not.
  absl::Status SetPinned(const ModelRow& row, bool pinned, v1::ResidentModel* response);
  absl::Status Unload(const v1::UnloadModelRequest& request);
  absl::Status SetDraining(bool draining, v1::ServerStatus* response);
  absl::Status List(v1::ListResidentModelsResponse* response) const;
  // Returns the record of a model by the name that an operator uses (ResolveOperatorsName).
  absl::StatusOr<ModelRow> FindNamed(const std::string& name) const;

  Operations& operations_;
  WorkerPool& pool_;
  const CallRunner& runner_;
  ModelLoader& models_;
  const ProjectAnswers projects_;
};

}  // namespace pepeseg
