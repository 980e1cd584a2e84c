#include "server/services/model_loader.h"

#include <algorithm>
#include <utility>

#include "absl/strings/str_cat.h"
#include "core/base/errors.h"
#include "core/base/status_macros.h"
#include "core/model_files/model_file.h"
#include "server/api/error.h"
#include "server/residency/memory_budget.h"
#include "server/store/quota.h"
#include "server/worker_protocol/job_folder.h"

namespace pepeseg {
namespace {

// Time after which a client should retry: most queries under way have ended by then.
constexpr absl::Duration kRetryAfter = absl::Seconds(1);

}  // namespace

absl::Status ModelLoader::WithBytes(const absl::Status& status, const MemoryBytes& need) const {
  const MemoryBudget* largest = nullptr;
  const auto size = [](const MemoryBudget& budget) {
    return budget.one_memory() ? budget.usable().host : budget.usable().device;
  };
  for (const ModelDevice& device : devices_.all()) {
    const MemoryBudget& budget = device.cache->budget();
    if (largest == nullptr || size(budget) > size(*largest)) largest = &budget;
  }
  const MemoryBudget& budget = *largest;
  const auto words = [&](const MemoryBytes& bytes) {
    return absl::StrCat(
        bytes.host, " bytes on the host",
        budget.one_memory() ? "" : absl::StrCat(", ", bytes.device, " on the device"));
  };
  ErrorDetail detail;
  const bool for_now = absl::IsUnavailable(status);
  detail.reason = for_now ? "NO_ROOM_NOW" : "DOES_NOT_FIT";
  if (for_now) detail.retry_after = kRetryAfter;
  // 0: the call has waited for the load of another call, which has computed the need.
  if (need.host > 0) detail.value = words(budget.Counted(need));
  detail.limit = words(budget.usable());
  return WithDetail(status, detail);
}

absl::StatusOr<MemoryShare> ModelLoader::ShareOf(const std::string& project,
                                                 const ModelDevice& device) const {
  MemoryShare share;
  share.owner = project;
  ASSIGN_OR_RETURN(const Quota quota, deps_.quotas.Get(share.owner));
  if (quota.resident_bytes <= 0) return share;
  const int64_t elsewhere = devices_.BytesOf(project, &device);
  share.limit = std::max<int64_t>(1, quota.resident_bytes - elsewhere);
  share.error = [limit = quota.resident_bytes, elsewhere](int64_t need) {
    return QuotaError("resident_bytes", need + elsewhere, limit);
  };
  return share;
}

absl::StatusOr<ModelRecord> ModelLoader::FindLive(const SceneRef& scene) const {
  auto model = deps_.store.models().GetLiveModel(scene);
  if (absl::IsFailedPrecondition(model.status())) {
    const auto job = deps_.store.jobs().FindActiveJob(scene);
    // The job is advice only: if it cannot be read, the error is the same without its name.
    const bool active = job.ok() && job->has_value();
    return WithResource(model.status(), "NO_MODEL", active ? JobName((*job)->id) : "");
  }
  return model;
}

absl::StatusOr<ModelRecord> ModelLoader::Find(const NamedScenes& scenes, const std::string& name,
                                              const std::string& field) const {
  ASSIGN_OR_RETURN(const SceneChild model, scenes.Model(name, field));
  return Find(model);
}

absl::StatusOr<ModelRecord> ModelLoader::Find(const SceneChild& model) const {
  // "live" is resolved at each call, so that a new model is used by the next request.
  if (model.number == kLiveModel) return FindLive(model.scene);
  auto record = deps_.store.models().GetModel(model.scene, model.number);
  if (absl::IsNotFound(record.status())) {
    return WithResource(record.status(), "NO_SUCH_MODEL",
                        ChildName(model.scene, "models", model.number));
  }
  return record;
}

absl::StatusOr<ResidentModel> ModelLoader::Load(const NamedScenes& scenes, const std::string& name,
                                                const std::string& field) {
  ASSIGN_OR_RETURN(const SceneChild model, scenes.Model(name, field));
  return Load(model);
}

absl::StatusOr<ResidentModel> ModelLoader::Load(const SceneChild& model) {
  ASSIGN_OR_RETURN(const ModelRecord record, Find(model));
  const std::filesystem::path folder = deps_.data_folder / record.folder;
  LoadableModel loadable;
  loadable.key = ResidentKey(record);
  loadable.name = ChildName(record.scene, "models", record.number);
  loadable.project = record.scene.project;
  loadable.shape = [&]() -> absl::StatusOr<ModelShape> {
    // The folder's name comes from the database, so it is checked to lie in the data folder before
    // it is opened.
    RETURN_IF_ERROR(CheckModelFolder(deps_.data_folder, record.folder));
    return ReadModelShape(folder);
  };
  loadable.read = [&] { return ReadModel(folder); };
  ASSIGN_OR_RETURN(ModelCache::Handle loaded, Load(loadable));
  return ResidentModel{loadable.name, std::move(loaded), {record.scene, record.number}};
}

absl::StatusOr<ModelCache::Handle> ModelLoader::Load(const LoadableModel& model) {
  MemoryBytes need;
  // The callbacks of a source run before Acquire returns, and only if the model is not in memory: a
  // hit costs no read of the disk or of the quota.
  const auto source_on = [&](const ModelDevice& device) {
    ModelCache::Source source;
    source.name = model.name;
    source.owner = model.project;
    source.need = [&]() -> absl::StatusOr<MemoryBytes> {
      ASSIGN_OR_RETURN(const ModelShape shape, model.shape());
      need = BytesOfModel(device.backend, shape);
      return need;
    };
    source.load = [&]() -> absl::StatusOr<std::unique_ptr<SceneModel>> {
      ASSIGN_OR_RETURN(Model read, model.read());
      return SceneModel::Create(device.backend, std::move(read), &map_counts_);
    };
    source.share = [&] { return ShareOf(model.project, device); };
    return source;
  };
  auto loaded = devices_.Acquire(model.key, source_on);
  if (IsNoRoom(loaded.status())) {
    // The error of a quota has a detail of its own, which WithBytes keeps.
    return WithBytes(WithPrefix(model.name + ": ", loaded.status()), need);
  }
  return loaded;
}

absl::StatusOr<ResidentModel> ModelLoader::LoadWithFeatures(const NamedScenes& scenes,
                                                            const std::string& name,
                                                            const std::string& field) {
  ASSIGN_OR_RETURN(ResidentModel model, Load(scenes, name, field));
  RETURN_IF_ERROR(CheckFeatures(model));
  return model;
}

absl::StatusOr<std::unique_ptr<ReservedMemory>> ModelLoader::TakeAnswerMemory(
    const std::string& project, int64_t bytes) {
  auto taken = devices_.TakeMemory(
      {bytes, 0}, [&](const ModelDevice& device) { return ShareOf(project, device); });
  return IsNoRoom(taken.status()) ? WithBytes(taken.status(), {bytes, 0}) : std::move(taken);
}

absl::StatusOr<std::unique_ptr<ReservedMemory>> ModelLoader::TakeServerMemory(
    const MemoryBytes& bytes) {
  auto taken = devices_.TakeMemory(bytes, [](const ModelDevice&) { return MemoryShare(); });
  return IsNoRoom(taken.status()) ? WithBytes(taken.status(), bytes) : std::move(taken);
}

absl::Status CheckFeatures(const ResidentModel& model) {
  if (model->has_features()) return absl::OkStatus();
  return WithResource(
      absl::FailedPreconditionError(absl::StrCat(
          model.name,
          " was trained without masks: it is rendered and exported, but has no segments")),
      "NO_FEATURES", model.name);
}

// The folder is that of the job's attempt, which is unique. The name is not: a scene that is
// deleted and created again counts its models from 1 again.
std::string ResidentKey(const ModelRecord& model) { return model.folder; }

}  // namespace pepeseg
