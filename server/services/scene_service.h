#pragma once

#include "pepeseg/v1/scene_service.grpc.pb.h"
#include "server/rpc/service_context.h"

namespace pepeseg {

class SceneServiceRpc final : public v1::SceneService::CallbackService {
 public:
  explicit SceneServiceRpc(const ServiceContext& context) : context_(context) {}

  grpc::ServerUnaryReactor* CreateScene(grpc::CallbackServerContext* call,
                                        const v1::CreateSceneRequest* request,
                                        v1::Scene* response) override;
  grpc::ServerUnaryReactor* GetScene(grpc::CallbackServerContext* call,
                                     const v1::GetSceneRequest* request,
                                     v1::Scene* response) override;
  grpc::ServerUnaryReactor* ListScenes(grpc::CallbackServerContext* call,
                                       const v1::ListScenesRequest* request,
                                       v1::ListScenesResponse* response) override;
  grpc::ServerUnaryReactor* DeleteScene(grpc::CallbackServerContext* call,
                                        const v1::DeleteSceneRequest* request,
                                        google::protobuf::Empty* response) override;
  grpc::ServerUnaryReactor* ListViews(grpc::CallbackServerContext* call,
                                      const v1::ListViewsRequest* request,
                                      v1::ListViewsResponse* response) override;
  grpc::ServerUnaryReactor* GetModel(grpc::CallbackServerContext* call,
                                     const v1::GetModelRequest* request,
                                     v1::Model* response) override;
  grpc::ServerUnaryReactor* DeleteModel(grpc::CallbackServerContext* call,
                                        const v1::DeleteModelRequest* request,
                                        google::protobuf::Empty* response) override;
  grpc::ServerUnaryReactor* ListModels(grpc::CallbackServerContext* call,
                                       const v1::ListModelsRequest* request,
                                       v1::ListModelsResponse* response) override;

 private:
  absl::Status FillScene(const SceneRow& row, const Caller& caller, v1::Scene* scene) const;

  const ServiceContext context_;
};

}  // namespace pepeseg
