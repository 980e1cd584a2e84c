#pragma once

#include "pepeseg/v1/scene_service.grpc.pb.h"
#include "server/data/blob_store.h"
#include "server/rpc/call_runner.h"
#include "server/services/model_loader.h"

namespace pepeseg {

// Answers calls about scenes and their models.
class SceneServiceRpc final : public v1::SceneService::CallbackService {
 public:
  // All must outlive it.
  SceneServiceRpc(const CallRunner& runner, ModelLoader& models, BlobStore& blobs);

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
  // Deletes a scene or a model, and its files and models in memory.
  absl::Status DeleteWithRemains(const SceneRef& scene);
  absl::Status DeleteModelWithFiles(const SceneChild& model);

  const CallRunner& runner_;
  ModelLoader& models_;
  Store& store_;
  BlobStore& blobs_;
};

}  // namespace pepeseg
