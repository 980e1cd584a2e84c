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
  // `operations` must outlive it.
  explicit AdminServiceRpc(Operations& operations);

  PEPESEG_UNARY(LoadModel, v1::LoadModelRequest, v1::ResidentModel)
  PEPESEG_UNARY(UnloadModel, v1::UnloadModelRequest, google::protobuf::Empty)
  PEPESEG_UNARY(PinModel, v1::PinModelRequest, v1::ResidentModel)
  PEPESEG_UNARY(UnpinModel, v1::UnpinModelRequest, v1::ResidentModel)
  PEPESEG_UNARY(ListResidentModels, v1::ListResidentModelsRequest, v1::ListResidentModelsResponse)
  PEPESEG_UNARY(CreateKey, v1::CreateKeyRequest, v1::CreateKeyResponse)
  PEPESEG_UNARY(GetKey, v1::GetKeyRequest, v1::ApiKey)
  PEPESEG_UNARY(ListKeys, v1::ListKeysRequest, v1::ListKeysResponse)
  PEPESEG_UNARY(RevokeKey, v1::RevokeKeyRequest, v1::ApiKey)
  PEPESEG_UNARY(GetProjectUsage, v1::GetProjectUsageRequest, v1::ProjectUsage)
  PEPESEG_UNARY(UpdateQuota, v1::UpdateQuotaRequest, v1::ProjectUsage)
  PEPESEG_UNARY(GetServerStatus, v1::GetServerStatusRequest, v1::ServerStatus)
  PEPESEG_UNARY(DrainServer, v1::DrainServerRequest, v1::ServerStatus)
  PEPESEG_UNARY(ResumeServer, v1::ResumeServerRequest, v1::ServerStatus)

 private:
  // Pins or unpins a model that is in memory, and describes it. NOT_FOUND: it is not.
  absl::Status SetPinned(const ModelRecord& record, bool pinned, v1::ResidentModel* response) const;
  absl::Status SetDraining(bool draining, v1::ServerStatus* response) const;
  // Returns the record of a model by the name that an operator uses (ResolveOperatorsName).
  absl::StatusOr<ModelRecord> FindNamed(const std::string& name) const;

  Operations& operations_;
  const CallRunner& runner_;
  ModelLoader& models_;
  const ProjectAnswers projects_;
};

}  // namespace pepeseg
