#include "server/services/scene_service.h"

#include <algorithm>
#include <charconv>
#include <optional>
#include <string>
#include <system_error>
#include <vector>

#include "absl/strings/str_cat.h"
#include "core/base/status_macros.h"
#include "server/api/convert.h"
#include "server/api/error.h"
#include "server/api/records_to_proto.h"
#include "server/api/resource_name.h"
#include "server/store/layout.h"
#include "server/worker_protocol/beneath_folder.h"

namespace pepeseg {
namespace {

constexpr int kDefaultPageSize = 50;

absl::Status CheckCreate(const v1::CreateSceneRequest& request) {
  RETURN_IF_ERROR(CheckId(request.scene_id(), "scene_id"));
  RETURN_IF_ERROR(CheckDisplayName(request.scene().display_name(), "scene.display_name"));
  return CheckRequestId(request.request_id());
}

// The remains of a scene after its records were deleted: folders of its jobs, partial uploads, and
// models in memory.
struct SceneRemains {
  std::vector<std::string> jobs;
  std::vector<UploadName> uploads;
  std::vector<std::string> resident_keys;
};

// Must run before the records are deleted. What appears in between, such as a job that ends, is
// left to the collector.
absl::StatusOr<SceneRemains> FindRemains(Store& store, const SceneRef& scene) {
  SceneRemains remains;
  PageRequest page{1000, ""};
  do {
    ASSIGN_OR_RETURN(const auto jobs, store.jobs().ListJobs({scene, std::nullopt}, page));
    for (const JobRecord& job : jobs.records) remains.jobs.push_back(job.id);
    page.page_token = jobs.next_page_token;
  } while (!page.page_token.empty());
  do {
    ASSIGN_OR_RETURN(const auto models, store.models().ListModels(scene, page));
    for (const ModelRecord& model : models.records)
      remains.resident_keys.push_back(ResidentKey(model));
    page.page_token = models.next_page_token;
  } while (!page.page_token.empty());
  ASSIGN_OR_RETURN(const auto uploads, store.datasets().ListOpenUploads(absl::InfiniteFuture()));
  for (const DatasetRecord& upload : uploads) {
    if (upload.scene == scene) remains.uploads.push_back({scene, upload.number});
  }
  return remains;
}

// Returns the files of a model's selections, relative to the data directory.
absl::StatusOr<std::vector<std::string>> FindSelectionFiles(Store& store,
                                                            const ModelRecord& model) {
  std::vector<std::string> files;
  PageRequest page{1000, ""};
  do {
    ASSIGN_OR_RETURN(const auto selections, store.selections().ListSelections(model.scene, page));
    for (const SelectionRecord& selection : selections.records) {
      if (selection.model == model.number) files.push_back(selection.file);
    }
    page.page_token = selections.next_page_token;
  } while (!page.page_token.empty());
  return files;
}

// Returns what must precede the name of a scene to make it unique: "projects/{project}/" for a
// caller who sees all projects, if another project has a scene of this id; else nothing. Names
// without a project mean the default project, so its scenes need no prefix.
absl::StatusOr<std::string> PrefixOf(Store& store, const SceneRef& scene, const Caller& caller) {
  if (!caller.sees_all_projects || scene.project == kDefaultProject) return std::string();
  ASSIGN_OR_RETURN(const std::vector<SceneRef> scenes, store.scenes().FindScenes(scene.name));
  return scenes.size() < 2 ? std::string() : absl::StrCat("projects/", scene.project, "/");
}

// Fills a page of the model's views. A page token is the index of the page's first view.
absl::Status FillViews(const Model& model, const PageRequest& page,
                       v1::ListViewsResponse* response) {
  const std::vector<ModelView>& views = model.views;
  size_t first = 0;
  const std::string& token = page.page_token;
  if (!token.empty()) {
    const auto [end, error] = std::from_chars(token.data(), token.data() + token.size(), first);
    if (error != std::errc() || end != token.data() + token.size() || first > views.size()) {
      return BadField("page_token", token, "not one of this list");
    }
  }
  // The token is checked to be at most the number of views, so `first + size` does not overflow.
  const size_t size = page.page_size == 0 ? kDefaultPageSize : page.page_size;
  const size_t last = std::min(views.size(), first + size);
  for (size_t i = first; i < last; ++i) {
    ModelView view = views[i];
    // A model's views are relative to its origin, for the precision of floats; clients get world
    // coordinates.
    view.cam_from_world = InWorld(model.origin, view.cam_from_world);
    *response->add_views() = ToProto(view);
  }
  if (last < views.size()) response->set_next_page_token(absl::StrCat(last));
  return absl::OkStatus();
}

}  // namespace

SceneServiceRpc::SceneServiceRpc(const CallRunner& runner, ModelLoader& models,
                                 JobSnapshots& snapshots, BlobStore& blobs)
    : runner_(runner),
      models_(models),
      snapshots_(snapshots),
      store_(models.store()),
      blobs_(blobs) {}

absl::Status SceneServiceRpc::FillScene(const SceneRecord& record, const Caller& caller,
                                        v1::Scene* scene) const {
  ASSIGN_OR_RETURN(const std::string prefix, PrefixOf(store_, record.scene, caller));
  scene->set_name(prefix + SceneName(record.scene));
  scene->set_display_name(record.display_name);
  *scene->mutable_create_time() = ToProto(record.create_time);
  const auto model = store_.models().GetLiveModel(record.scene);
  if (model.ok()) {
    scene->set_live_model(prefix + ChildName(record.scene, "models", model->number));
    // FAILED_PRECONDITION means that the scene has no model yet.
  } else if (!absl::IsFailedPrecondition(model.status())) {
    return model.status();
  }
  ASSIGN_OR_RETURN(const auto job, store_.jobs().FindActiveJob(record.scene));
  if (job.has_value()) scene->set_active_job(JobName(job->id));
  return absl::OkStatus();
}

absl::Status SceneServiceRpc::DeleteWithRemains(const SceneRef& scene) const {
  // The records go first: if the server is killed afterwards, files without a record are left,
  // which the collector removes. The other order would leave records without files.
  ASSIGN_OR_RETURN(const SceneRemains remains, FindRemains(store_, scene));
  const absl::Status deleted = store_.scenes().DeleteScene(scene);
  if (absl::IsFailedPrecondition(deleted)) {
    const auto job = store_.jobs().FindActiveJob(scene);
    const bool active = job.ok() && job->has_value();
    return WithResource(deleted, "JOB_ACTIVE", active ? JobName((*job)->id) : "");
  }
  RETURN_IF_ERROR(deleted);
  for (const std::string& key : remains.resident_keys) models_.devices().Drop(key);
  for (const UploadName& upload : remains.uploads) blobs_.RemovePartial(upload);
  // The scene is gone already: a folder that cannot be removed only costs space.
  std::error_code ignored;
  for (const std::string& job : remains.jobs) {
    RemoveBeneath(models_.data_folder(), std::filesystem::path("jobs") / job).IgnoreError();
  }
  std::filesystem::remove_all(DatasetFolder(models_.data_folder(), scene), ignored);
  std::filesystem::remove_all(models_.data_folder() / SelectionFolder(scene), ignored);
  std::filesystem::remove_all(models_.data_folder() / ModelVersionFolder(scene), ignored);
  return absl::OkStatus();
}

absl::Status SceneServiceRpc::DeleteModelWithFiles(const SceneChild& model) const {
  ASSIGN_OR_RETURN(const ModelRecord record, models_.Find(model));
  // Before the deletion, whose cascade removes the records of the selections.
  ASSIGN_OR_RETURN(const auto selections, FindSelectionFiles(store_, record));
  RETURN_IF_ERROR(store_.models().DeleteModel(record.scene, record.number));
  models_.devices().Drop(ResidentKey(record));  // queries under way still hold it
  // The model is gone already. Files that cannot be removed are removed by the collector.
  RemoveBeneath(models_.data_folder(), record.folder).IgnoreError();
  std::error_code ignored;
  for (const std::string& file : selections) {
    std::filesystem::remove(models_.data_folder() / file, ignored);
  }
  return absl::OkStatus();
}

absl::Status SceneServiceRpc::CreateScene(const UnaryCall& call,
                                          const v1::CreateSceneRequest& request,
                                          v1::Scene* response) const {
  RETURN_IF_ERROR(CheckCreate(request));
  SceneRecord record;
  record.display_name = request.scene().display_name();
  record.request_id = request.request_id();
  record.scene = {0, call.caller.project, request.scene_id()};
  const auto scene = store_.scenes().CreateScene(record);
  if (absl::IsAlreadyExists(scene.status())) {
    return WithResource(scene.status(), "SCENE_EXISTS", SceneName(record.scene));
  }
  RETURN_IF_ERROR(scene.status());
  return FillScene(*scene, call.caller, response);
}

absl::Status SceneServiceRpc::GetScene(const UnaryCall& call, const v1::GetSceneRequest& request,
                                       v1::Scene* response) const {
  const auto scene = call.scenes().Scene(request.name(), "name");
  RETURN_IF_ERROR(scene.status());
  const auto record = store_.scenes().GetScene(*scene);
  if (!record.ok()) return WithResource(record.status(), "NO_SUCH_SCENE", request.name());
  return FillScene(*record, call.caller, response);
}

absl::Status SceneServiceRpc::ListScenes(const UnaryCall& call,
                                         const v1::ListScenesRequest& request,
                                         v1::ListScenesResponse* response) const {
  ASSIGN_OR_RETURN(const PageRequest page,
                   PageFromProto(request.page_size(), request.page_token()));
  ASSIGN_OR_RETURN(const Page<SceneRecord> scenes,
                   store_.scenes().ListScenes(page, call.caller.visible_project()));
  for (const SceneRecord& record : scenes.records) {
    RETURN_IF_ERROR(FillScene(record, call.caller, response->add_scenes()));
  }
  response->set_next_page_token(scenes.next_page_token);
  return absl::OkStatus();
}

absl::Status SceneServiceRpc::DeleteScene(const UnaryCall& call,
                                          const v1::DeleteSceneRequest& request,
                                          google::protobuf::Empty* /*response*/) const {
  const auto scene = call.scenes().Scene(request.name(), "name");
  RETURN_IF_ERROR(scene.status());
  return DeleteWithRemains(*scene);
}

absl::Status SceneServiceRpc::ListViews(const UnaryCall& call, const v1::ListViewsRequest& request,
                                        v1::ListViewsResponse* response) const {
  ASSIGN_OR_RETURN(const PageRequest page,
                   PageFromProto(request.page_size(), request.page_token()));
  ASSIGN_OR_RETURN(const ResidentModel model,
                   snapshots_.Load(call.scenes(), request.parent(), "parent"));
  return FillViews(model->model(), page, response);
}

absl::Status SceneServiceRpc::GetModel(const UnaryCall& call, const v1::GetModelRequest& request,
                                       v1::Model* response) const {
  const auto record = models_.Find(call.scenes(), request.name(), "name");
  RETURN_IF_ERROR(record.status());
  *response = ToProto(*record);
  return absl::OkStatus();
}

absl::Status SceneServiceRpc::SetLiveModel(const UnaryCall& call,
                                           const v1::SetLiveModelRequest& request,
                                           v1::Scene* response) const {
  ASSIGN_OR_RETURN(const ModelRecord model, models_.Find(call.scenes(), request.name(), "name"));
  RETURN_IF_ERROR(store_.models().SetLiveModel(model.scene, model.number));
  ASSIGN_OR_RETURN(const SceneRecord scene, store_.scenes().GetScene(model.scene));
  return FillScene(scene, call.caller, response);
}

absl::Status SceneServiceRpc::DeleteModel(const UnaryCall& call,
                                          const v1::DeleteModelRequest& request,
                                          google::protobuf::Empty* /*response*/) const {
  ASSIGN_OR_RETURN(const SceneChild model, call.scenes().Model(request.name(), "name"));
  return DeleteModelWithFiles(model);
}

absl::Status SceneServiceRpc::ListModels(const UnaryCall& call,
                                         const v1::ListModelsRequest& request,
                                         v1::ListModelsResponse* response) const {
  ASSIGN_OR_RETURN(const SceneRef scene, call.scenes().Scene(request.parent(), "parent"));
  ASSIGN_OR_RETURN(const PageRequest page,
                   PageFromProto(request.page_size(), request.page_token()));
  ASSIGN_OR_RETURN(const Page<ModelRecord> models, store_.models().ListModels(scene, page));
  for (const ModelRecord& record : models.records) *response->add_models() = ToProto(record);
  response->set_next_page_token(models.next_page_token);
  return absl::OkStatus();
}

}  // namespace pepeseg
