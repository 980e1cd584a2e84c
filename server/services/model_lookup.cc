#include "server/services/model_lookup.h"

#include <utility>

#include "absl/strings/str_cat.h"
#include "core/base/private_error.h"
#include "core/base/status_macros.h"
#include "core/model_files/model_file.h"
#include "server/api/error.h"
#include "server/api/resource_name.h"
#include "server/residency/model_bytes.h"
#include "server/store/quota.h"
#include "server/worker_protocol/job_folder.h"

namespace pepeseg {
namespace {

// Until queries under way end, which mostly take less.
constexpr int kRetrySeconds = 1;

// Need and have in the detail too.
absl::Status WithBytes(const absl::Status& status, const MemoryBytes& need,
                       const MemoryBudget& budget) {
  const auto words = [&](const MemoryBytes& bytes) {
    return absl::StrCat(
        bytes.host, " bytes on the host",
        budget.one_memory() ? "" : absl::StrCat(", ", bytes.device, " on the device"));
  };
  v1::ErrorDetail detail;
  const bool for_now = absl::IsUnavailable(status);
  detail.set_reason(for_now ? "NO_ROOM_NOW" : "DOES_NOT_FIT");
  if (for_now) detail.mutable_retry_after()->set_seconds(kRetrySeconds);
  // This call's own; one that waited for another's load has none.
  if (need.host > 0) detail.set_value(words(budget.Counted(need)));
  detail.set_limit(words(budget.usable()));
  return WithDetail(status, detail);
}

// The project's that the scene belongs to.
absl::StatusOr<ModelCache::Share> ShareOf(const ServiceContext& context, const std::string& scene) {
  ModelCache::Share share;
  ASSIGN_OR_RETURN(share.owner, context.store->scenes().ProjectOfScene(scene));
  ASSIGN_OR_RETURN(const Quota quota, context.quotas->Get(share.owner));
  share.limit = quota.resident_bytes;
  share.error = [limit = share.limit](int64_t need) {
    return QuotaError("resident_bytes", need, limit);
  };
  return share;
}

absl::StatusOr<ModelRow> FindLiveModel(const ServiceContext& context, const std::string& scene) {
  auto model = context.store->models().GetLiveModel(scene);
  if (absl::IsFailedPrecondition(model.status())) {
    const auto job = context.store->jobs().FindActiveJob(scene);
    const bool active = job.ok() && job->has_value();
    return WithResource(model.status(), "NO_MODEL", active ? JobName((*job)->id) : "");
  }
  return model;
}

}  // namespace

absl::StatusOr<ModelRow> FindModel(const ServiceContext& context, const std::string& name,
                                   const std::string& field) {
  ASSIGN_OR_RETURN(const SceneChild model, ParseModelName(name, field));
  if (model.number == kLiveModel) return FindLiveModel(context, model.scene);
  auto row = context.store->models().GetModel(model.scene, model.number);
  if (absl::IsNotFound(row.status())) return WithResource(row.status(), "NO_SUCH_MODEL", name);
  return row;
}

absl::StatusOr<ResidentModel> LoadModel(const ServiceContext& context, const std::string& name,
                                        const std::string& field) {
  ASSIGN_OR_RETURN(const ModelRow row, FindModel(context, name, field));
  MemoryBytes need;
  const std::filesystem::path folder = context.data_folder / row.folder;
  ModelCache::Source source;
  source.name = KeyedChildName(row.scene, "models", row.number);
  source.need = [&]() -> absl::StatusOr<MemoryBytes> {
    RETURN_IF_ERROR(CheckModelFolder(context.data_folder, row.folder));
    ASSIGN_OR_RETURN(const ModelShape shape, ReadModelShape(folder));
    need = BytesOfModel(*context.backend, shape);
    return need;
  };
  source.load = [&]() -> absl::StatusOr<std::unique_ptr<Segmenter>> {
    ASSIGN_OR_RETURN(Model model, ReadModel(folder));
    return Segmenter::Create(*context.backend, std::move(model), context.map_counts);
  };
  source.share = [&] { return ShareOf(context, row.scene); };
  auto segmenter = context.models->Acquire(ResidentKey(row), source);
  // A source's own UNAVAILABLE, of the database, says nothing of memory.
  const bool no_room = absl::IsResourceExhausted(segmenter.status()) ||
                       (absl::IsUnavailable(segmenter.status()) && !IsPrivate(segmenter.status()));
  if (no_room) {
    // A quota's error has its own need and limit.
    return WithBytes(WithPrefix(source.name + ": ", segmenter.status()), need,
                     context.models->budget());
  }
  RETURN_IF_ERROR(segmenter.status());
  return ResidentModel{
      ChildName(row.scene, "models", row.number), *std::move(segmenter), {row.scene, row.number}};
}

absl::StatusOr<ResidentModel> LoadModelWithFeatures(const ServiceContext& context,
                                                    const std::string& name,
                                                    const std::string& field) {
  ASSIGN_OR_RETURN(ResidentModel model, LoadModel(context, name, field));
  RETURN_IF_ERROR(CheckFeatures(model));
  return model;
}

absl::Status CheckFeatures(const ResidentModel& model) {
  if (model.segmenter->has_features()) return absl::OkStatus();
  return WithResource(
      absl::FailedPreconditionError(absl::StrCat(
          model.name,
          " was trained without masks: it is rendered and exported, but has no segments")),
      "NO_FEATURES", model.name);
}

absl::StatusOr<std::unique_ptr<ReservedMemory>> TakeAnswerMemory(const ServiceContext& context,
                                                                 const std::string& scene,
                                                                 int64_t bytes) {
  ASSIGN_OR_RETURN(const ModelCache::Share share, ShareOf(context, scene));
  const MemoryBytes need = {bytes, 0};
  auto taken = context.models->TakeMemory(need, share);
  if (!absl::IsResourceExhausted(taken.status()) && !absl::IsUnavailable(taken.status())) {
    return taken;
  }
  return WithBytes(taken.status(), need, context.models->budget());
}

std::string ResidentKey(const ModelRow& model) { return model.folder; }

}  // namespace pepeseg
