#pragma once

#include "pepeseg/v1/scene_service.grpc.pb.h"
#include "server/data/blob_store.h"
#include "server/rpc/call_runner.h"
#include "server/services/job_snapshots.h"
#include "server/services/model_loader.h"

namespace pepeseg {

// Answers calls about scenes and their models.
class SceneServiceRpc final : public v1::SceneService::CallbackService {
 public:
  // All must outlive it.
  SceneServiceRpc(const CallRunner& runner, ModelLoader& models, JobSnapshots& snapshots,
                  BlobStore& blobs);

  PEPESEG_UNARY(CreateScene, v1::CreateSceneRequest, v1::Scene)
  PEPESEG_UNARY(GetScene, v1::GetSceneRequest, v1::Scene)
  PEPESEG_UNARY(ListScenes, v1::ListScenesRequest, v1::ListScenesResponse)
  PEPESEG_UNARY(DeleteScene, v1::DeleteSceneRequest, google::protobuf::Empty)
  PEPESEG_UNARY(ListViews, v1::ListViewsRequest, v1::ListViewsResponse)
  PEPESEG_UNARY(GetModel, v1::GetModelRequest, v1::Model)
  PEPESEG_UNARY(SetLiveModel, v1::SetLiveModelRequest, v1::Scene)
  PEPESEG_UNARY(DeleteModel, v1::DeleteModelRequest, google::protobuf::Empty)
  PEPESEG_UNARY(ListModels, v1::ListModelsRequest, v1::ListModelsResponse)

 private:
  absl::Status FillScene(const SceneRecord& record, const Caller& caller, v1::Scene* scene) const;
  // Deletes a scene or a model, and its files and models in memory.
  absl::Status DeleteWithRemains(const SceneRef& scene) const;
  absl::Status DeleteModelWithFiles(const SceneChild& model) const;

  const CallRunner& runner_;
  ModelLoader& models_;
  JobSnapshots& snapshots_;
  Store& store_;
  BlobStore& blobs_;
};

}  // namespace pepeseg
