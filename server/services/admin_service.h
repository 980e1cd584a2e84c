#pragma once

#include "pepeseg/v1/admin_service.grpc.pb.h"
#include "server/rpc/service_context.h"
#include "server/services/operations.h"

namespace pepeseg {

class AdminServiceRpc final : public v1::AdminService::CallbackService {
 public:
  // `context.pool`: for the calls of this service. `operations` outlives it.
  AdminServiceRpc(const ServiceContext& context, Operations& operations)
      : context_(context), operations_(operations) {}

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
  const ServiceContext context_;
  Operations& operations_;
};

}  // namespace pepeseg
