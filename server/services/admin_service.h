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
  AdminServiceRpc(Operations& operations, WorkerPool& pool)
      : operations_(operations),
        pool_(pool),
        runner_(operations.runner()),
        models_(operations.models()),
        projects_(runner_.quotas(), models_) {}

  grpc::ServerUnaryReactor* LoadModel(grpc::CallbackServerContext* call,
                                      const v1::LoadModelRequest* request,
                                      v1::ResidentModel* response) override;
  grpc::ServerUnaryReactor* UnloadModel(grpc::CallbackServerContext* call,
                                        const v1::UnloadModelRequest* request,
                                        google::protobuf::Empty* response) override;
  grpc::ServerUnaryReactor* PinModel(grpc::CallbackServerContext* call,
                                     const v1::PinModelRequest* request,
                                     v1::ResidentModel* response) override;
  grpc::ServerUnaryReactor* ListResident(grpc::CallbackServerContext* call,
                                         const v1::ListResidentRequest* request,
                                         v1::ListResidentResponse* response) override;
  grpc::ServerUnaryReactor* CreateKey(grpc::CallbackServerContext* call,
                                      const v1::CreateKeyRequest* request,
                                      v1::CreateKeyResponse* response) override;
  grpc::ServerUnaryReactor* ListKeys(grpc::CallbackServerContext* call,
                                     const v1::ListKeysRequest* request,
                                     v1::ListKeysResponse* response) override;
  grpc::ServerUnaryReactor* RevokeKey(grpc::CallbackServerContext* call,
                                      const v1::RevokeKeyRequest* request,
                                      v1::ApiKey* response) override;
  grpc::ServerUnaryReactor* GetProjectUsage(grpc::CallbackServerContext* call,
                                            const v1::GetProjectUsageRequest* request,
                                            v1::ProjectUsage* response) override;
  grpc::ServerUnaryReactor* SetQuota(grpc::CallbackServerContext* call,
                                     const v1::SetQuotaRequest* request,
                                     v1::ProjectUsage* response) override;
  grpc::ServerUnaryReactor* GetStatus(grpc::CallbackServerContext* call,
                                      const v1::GetStatusRequest* request,
                                      v1::ServerStatus* response) override;
  grpc::ServerUnaryReactor* Drain(grpc::CallbackServerContext* call,
                                  const v1::DrainRequest* request,
                                  v1::ServerStatus* response) override;

 private:
  absl::Status Load(const v1::LoadModelRequest& request, v1::ResidentModel* response);
  absl::Status Pin(const v1::PinModelRequest& request, v1::ResidentModel* response);
  absl::Status Unload(const v1::UnloadModelRequest& request);
  absl::Status List(v1::ListResidentResponse* response) const;
  // Returns the record of a model by the name that an operator uses (ResolveOperatorsName).
  absl::StatusOr<ModelRow> FindNamed(const std::string& name) const;

  Operations& operations_;
  WorkerPool& pool_;
  const CallRunner& runner_;
  ModelLoader& models_;
  const ProjectAnswers projects_;
};

}  // namespace pepeseg
