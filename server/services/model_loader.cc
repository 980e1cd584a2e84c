#include "server/services/model_loader.h"

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

// Adds the bytes needed and available to the detail of `status`.
absl::Status WithBytes(const absl::Status& status, const MemoryBytes& need,
                       const MemoryBudget& budget) {
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

}  // namespace

absl::StatusOr<ModelCache::Share> ModelLoader::ShareOf(const std::string& project) const {
  ModelCache::Share share;
  share.owner = project;
  ASSIGN_OR_RETURN(const Quota quota, deps_.quotas.Get(share.owner));
  share.limit = quota.resident_bytes;
  share.error = [limit = share.limit](int64_t need) {
    return QuotaError("resident_bytes", need, limit);
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
  ModelCache::Source source;
  source.name = model.name;
  source.owner = model.project;
  source.need = [&]() -> absl::StatusOr<MemoryBytes> {
    ASSIGN_OR_RETURN(const ModelShape shape, model.shape());
    need = BytesOfModel(deps_.backend, shape);
    return need;
  };
  source.load = [&]() -> absl::StatusOr<std::unique_ptr<SceneModel>> {
    ASSIGN_OR_RETURN(Model read, model.read());
    return SceneModel::Create(deps_.backend, std::move(read), &map_counts_);
  };
  // The callbacks run before Acquire returns, and only if the model is not in memory: a hit costs
  // no read of the disk or of the quota.
  source.share = [&] { return ShareOf(model.project); };
  auto loaded = cache_->Acquire(model.key, source);
  // An UNAVAILABLE of the database is private and says nothing about memory.
  const bool no_room = absl::IsResourceExhausted(loaded.status()) ||
                       (absl::IsUnavailable(loaded.status()) && !IsPrivate(loaded.status()));
  if (no_room) {
    // The error of a quota has a detail of its own, which WithBytes keeps.
    return WithBytes(WithPrefix(source.name + ": ", loaded.status()), need, cache_->budget());
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
  ASSIGN_OR_RETURN(const ModelCache::Share share, ShareOf(project));
  return TakeMemory(share, {bytes, 0});
}

absl::StatusOr<std::unique_ptr<ReservedMemory>> ModelLoader::TakeServerMemory(
    const MemoryBytes& bytes) {
  return TakeMemory({}, bytes);
}

absl::StatusOr<std::unique_ptr<ReservedMemory>> ModelLoader::TakeMemory(
    const ModelCache::Share& share, const MemoryBytes& need) {
  auto taken = cache_->TakeMemory(need, share);
  if (!absl::IsResourceExhausted(taken.status()) && !absl::IsUnavailable(taken.status())) {
    return taken;
  }
  return WithBytes(taken.status(), need, cache_->budget());
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
