#include "server/services/admin_service.h"

#include <map>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "core/base/status_macros.h"
#include "server/access/scene_names.h"
#include "server/api/convert.h"
#include "server/api/error.h"
#include "server/api/resource_name.h"

namespace pepeseg {
namespace {

v1::ResidentModel Describe(const ModelDevice& device, const ModelCache::Info& info,
                           const SceneModel& resident) {
  v1::ResidentModel model;
  model.set_device(device.id);
  model.set_name(info.name);
  model.set_host_bytes(info.bytes.host);
  model.set_device_bytes(info.bytes.device);
  model.set_pinned(info.pinned);
  *model.mutable_last_use_time() = ToProto(info.last_use);
  model.set_queries_in_flight(info.num_handles);
  model.set_cached_maps(resident.segmenter().num_maps());
  model.set_num_renders(resident.segmenter().num_renders());
  return model;
}

void FillDescription(const ModelDevices& models, const SceneChild& model,
                     v1::ResidentModel* response) {
  response->set_name(ChildName(model.scene, "models", model.number));
  models.Visit(
      [&](const ModelDevice& device, const ModelCache::Info& info, const SceneModel& resident) {
        // Not found: the model was evicted just now, and the answer has its name only.
        const bool found = info.name == response->name() && info.owner == model.scene.project;
        if (found) *response = Describe(device, info, resident);
      });
}

// Puts the project before the names of models that have the same name.
void TellApart(const std::vector<std::string>& projects, v1::ListResidentModelsResponse* response) {
  std::map<std::string, int> num_of_name;
  for (const v1::ResidentModel& model : response->models()) ++num_of_name[model.name()];
  for (int i = 0; i < response->models_size(); ++i) {
    v1::ResidentModel& model = *response->mutable_models(i);
    if (num_of_name.at(model.name()) == 1) continue;
    model.set_name(absl::StrCat("projects/", projects[i], "/", model.name()));
  }
}

void AddUse(int64_t reserved, int64_t limit, v1::MemoryUse* use) {
  use->set_reserved_bytes(use->reserved_bytes() + reserved);
  use->set_limit_bytes(use->limit_bytes() + limit);
}

// Adds the memory and the counts of a device's models to the sums of all.
void AddDevice(const ModelDevice& device, v1::ListResidentModelsResponse* response) {
  const ModelCache& models = *device.cache;
  const MemoryBytes used = models.bytes_in_use(), limit = models.budget().usable();
  AddUse(used.host, limit.host, response->mutable_host());
  if (!models.budget().one_memory()) {
    AddUse(used.device, limit.device, response->mutable_device());
  }
  const auto in_use = static_cast<int64_t>(device.backend.bytes_in_use());
  response->set_device_bytes_in_use(response->device_bytes_in_use() + in_use);
  const ModelCache::Counts counts = models.counts();
  response->set_num_loads(response->num_loads() + counts.num_loads);
  response->set_num_evictions(response->num_evictions() + counts.num_evictions);
}

}  // namespace

AdminServiceRpc::AdminServiceRpc(Operations& operations)
    : operations_(operations),
      runner_(operations.runner()),
      models_(operations.models()),
      projects_(runner_.quotas(), models_) {}

absl::StatusOr<ModelRecord> AdminServiceRpc::FindNamed(const std::string& name) const {
  ASSIGN_OR_RETURN(const NamedScenes scenes, ResolveOperatorsName(models_.store(), name, "name"));
  return models_.Find(scenes, name, "name");
}

absl::Status AdminServiceRpc::LoadModel(const UnaryCall& /*call*/,
                                        const v1::LoadModelRequest& request,
                                        v1::ResidentModel* response) const {
  // Held until the answer is filled in, so that it is not evicted before.
  ASSIGN_OR_RETURN(const NamedScenes scenes,
                   ResolveOperatorsName(models_.store(), request.name(), "name"));
  ASSIGN_OR_RETURN(const ResidentModel model, models_.Load(scenes, request.name(), "name"));
  FillDescription(models_.devices(), model.id, response);
  response->set_queries_in_flight(response->queries_in_flight() - 1);  // this call is not a query
  return absl::OkStatus();
}

absl::Status AdminServiceRpc::PinModel(const UnaryCall& /*call*/,
                                       const v1::PinModelRequest& request,
                                       v1::ResidentModel* response) const {
  ASSIGN_OR_RETURN(const ModelRecord record, FindNamed(request.name()));
  // Held, so that the model is not evicted before it is pinned.
  ASSIGN_OR_RETURN(const ResidentModel held, models_.Load({record.scene, record.number}));
  RETURN_IF_ERROR(SetPinned(record, true, response));
  response->set_queries_in_flight(response->queries_in_flight() - 1);  // this call is not a query
  return absl::OkStatus();
}

absl::Status AdminServiceRpc::UnpinModel(const UnaryCall& /*call*/,
                                         const v1::UnpinModelRequest& request,
                                         v1::ResidentModel* response) const {
  ASSIGN_OR_RETURN(const ModelRecord record, FindNamed(request.name()));
  return SetPinned(record, false, response);
}

absl::Status AdminServiceRpc::SetPinned(const ModelRecord& record, bool pinned,
                                        v1::ResidentModel* response) const {
  const absl::Status status = models_.devices().SetPinned(ResidentKey(record), pinned);
  if (!status.ok()) {
    return WithResource(status, "NOT_RESIDENT", ChildName(record.scene, "models", record.number));
  }
  FillDescription(models_.devices(), {record.scene, record.number}, response);
  return absl::OkStatus();
}

absl::Status AdminServiceRpc::UnloadModel(const UnaryCall& /*call*/,
                                          const v1::UnloadModelRequest& request,
                                          google::protobuf::Empty* /*response*/) const {
  ASSIGN_OR_RETURN(const ModelRecord record, FindNamed(request.name()));
  const std::string name = ChildName(record.scene, "models", record.number);
  const absl::Status status = models_.devices().Unload(ResidentKey(record));
  if (status.ok()) return absl::OkStatus();
  // NOT_FOUND: not in memory. Any other error: the model is pinned.
  const absl::Status named(status.code(), absl::StrCat(name, ": ", status.message()));
  return WithResource(named, absl::IsNotFound(status) ? "NOT_RESIDENT" : "PINNED", name);
}

absl::Status AdminServiceRpc::SetDraining(bool draining, v1::ServerStatus* response) const {
  operations_.SetDraining(draining);
  return operations_.FillStatus(response);
}

absl::Status AdminServiceRpc::ListResidentModels(const UnaryCall& /*call*/,
                                                 const v1::ListResidentModelsRequest& /*request*/,
                                                 v1::ListResidentModelsResponse* response) const {
  std::vector<std::string> projects;
  models_.devices().Visit(
      [&](const ModelDevice& device, const ModelCache::Info& info, const SceneModel& resident) {
        *response->add_models() = Describe(device, info, resident);
        projects.push_back(info.owner);
      });
  TellApart(projects, response);
  for (const ModelDevice& device : models_.devices().all()) AddDevice(device, response);
  return absl::OkStatus();
}

absl::Status AdminServiceRpc::CreateKey(const UnaryCall& /*call*/,
                                        const v1::CreateKeyRequest& request,
                                        v1::CreateKeyResponse* response) const {
  return projects_.CreateKey(request, response);
}

absl::Status AdminServiceRpc::GetKey(const UnaryCall& /*call*/, const v1::GetKeyRequest& request,
                                     v1::ApiKey* response) const {
  return projects_.GetKey(request, response);
}

absl::Status AdminServiceRpc::ListKeys(const UnaryCall& /*call*/,
                                       const v1::ListKeysRequest& request,
                                       v1::ListKeysResponse* response) const {
  return projects_.ListKeys(request, response);
}

absl::Status AdminServiceRpc::RevokeKey(const UnaryCall& /*call*/,
                                        const v1::RevokeKeyRequest& request,
                                        v1::ApiKey* response) const {
  return projects_.RevokeKey(request, response);
}

absl::Status AdminServiceRpc::GetProjectUsage(const UnaryCall& /*call*/,
                                              const v1::GetProjectUsageRequest& request,
                                              v1::ProjectUsage* response) const {
  return projects_.GetProjectUsage(request, response);
}

absl::Status AdminServiceRpc::UpdateQuota(const UnaryCall& /*call*/,
                                          const v1::UpdateQuotaRequest& request,
                                          v1::ProjectUsage* response) const {
  return projects_.UpdateQuota(request, response);
}

absl::Status AdminServiceRpc::GetServerStatus(const UnaryCall& /*call*/,
                                              const v1::GetServerStatusRequest& /*request*/,
                                              v1::ServerStatus* response) const {
  return operations_.FillStatus(response);
}

absl::Status AdminServiceRpc::DrainServer(const UnaryCall& /*call*/,
                                          const v1::DrainServerRequest& /*request*/,
                                          v1::ServerStatus* response) const {
  return SetDraining(true, response);
}

absl::Status AdminServiceRpc::ResumeServer(const UnaryCall& /*call*/,
                                           const v1::ResumeServerRequest& /*request*/,
                                           v1::ServerStatus* response) const {
  return SetDraining(false, response);
}

}  // namespace pepeseg
