#include "server/rpc/model_lookup.h"

#include <utility>

#include "core/io/model_file.h"
#include "core/status_macros.h"
#include "kernels/gaussian_planes.h"
#include "server/rpc/error.h"
#include "server/rpc/resource_name.h"

namespace pepeseg {
namespace {

constexpr int64_t kFeatureFloats = 32;

// Gaussians and features, once on the host and once on the backend, as if of the highest degree.
int64_t ResidentBytes(const ModelRow& model) {
  const int64_t floats = NumPlanes(kMaxShDegree) + kFeatureFloats;
  return model.num_gaussians * floats * static_cast<int64_t>(sizeof(float)) * 2;
}

absl::StatusOr<ModelRow> FindLiveModel(const ServiceContext& context, const std::string& scene) {
  auto model = context.store->GetLiveModel(scene);
  if (absl::IsFailedPrecondition(model.status())) {
    const auto job = context.store->FindActiveJob(scene);
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
  auto row = context.store->GetModel(model.scene, model.number);
  if (absl::IsNotFound(row.status())) return WithResource(row.status(), "NO_SUCH_MODEL", name);
  return row;
}

absl::StatusOr<ResidentModel> LoadModel(const ServiceContext& context, const std::string& name,
                                        const std::string& field) {
  ASSIGN_OR_RETURN(const ModelRow row, FindModel(context, name, field));
  const auto load = [&]() -> absl::StatusOr<std::unique_ptr<Segmenter>> {
    ASSIGN_OR_RETURN(Model model, ReadModel(context.data_folder / row.folder));
    return Segmenter::Create(*context.backend, std::move(model));
  };
  ResidentModel resident;
  ASSIGN_OR_RETURN(resident.segmenter,
                   context.models->Acquire(ResidentKey(row), ResidentBytes(row), load));
  resident.name = ChildName(row.scene, "models", row.number);
  return resident;
}

std::string ResidentKey(const ModelRow& model) { return model.folder; }

}  // namespace pepeseg
