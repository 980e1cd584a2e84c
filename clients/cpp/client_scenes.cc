// A client's calls about scenes and models.
#include "clients/cpp/ask.h"
#include "clients/cpp/client.h"
#include "clients/cpp/status_macros.h"

namespace pepeseg::client {

using Scenes = v1::SceneService::Stub;

Client::Client(const std::shared_ptr<grpc::Channel>& channel)
    : scenes_(v1::SceneService::NewStub(channel)),
      datasets_(v1::DatasetService::NewStub(channel)),
      jobs_(v1::JobService::NewStub(channel)),
      segmentation_(v1::SegmentationService::NewStub(channel)) {}

absl::Status Client::EnsureScene(const std::string& scene) const {
  v1::CreateSceneRequest request;
  request.set_scene_id(SceneName(scene).substr(std::string("scenes/").size()));
  request.set_request_id(NewRequestId());
  const absl::Status status = Ask(*scenes_, &Scenes::CreateScene, scene, request).status();
  return absl::IsAlreadyExists(status) ? absl::OkStatus() : status;
}

absl::StatusOr<v1::Scene> Client::GetScene(const std::string& scene) const {
  v1::GetSceneRequest request;
  request.set_name(SceneName(scene));
  return Ask(*scenes_, &Scenes::GetScene, scene, request);
}

absl::StatusOr<v1::ListScenesResponse> Client::ListScenes() const {
  return AskAllPages(*scenes_, &Scenes::ListScenes, "", v1::ListScenesRequest());
}

absl::Status Client::DeleteScene(const std::string& scene) const {
  v1::DeleteSceneRequest request;
  request.set_name(SceneName(scene));
  return Ask(*scenes_, &Scenes::DeleteScene, scene, request).status();
}

absl::StatusOr<v1::Model> Client::GetModel(const std::string& model) const {
  v1::GetModelRequest request;
  request.set_name(model);
  return Ask(*scenes_, &Scenes::GetModel, SceneOf(model), request);
}

absl::StatusOr<v1::ListModelsResponse> Client::ListModels(const std::string& scene) const {
  v1::ListModelsRequest request;
  request.set_parent(SceneName(scene));
  return AskAllPages(*scenes_, &Scenes::ListModels, scene, request);
}

absl::Status Client::DeleteModel(const std::string& model) const {
  v1::DeleteModelRequest request;
  request.set_name(model);
  return Ask(*scenes_, &Scenes::DeleteModel, SceneOf(model), request).status();
}

absl::StatusOr<std::vector<v1::View>> Client::ListViews(const std::string& model) const {
  v1::ListViewsRequest request;
  request.set_parent(model);
  ASSIGN_OR_RETURN(const v1::ListViewsResponse all,
                   AskAllPages(*scenes_, &Scenes::ListViews, SceneOf(model), request));
  return std::vector<v1::View>(all.views().begin(), all.views().end());
}

}  // namespace pepeseg::client
