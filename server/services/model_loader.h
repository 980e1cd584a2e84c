#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "core/query/scene_model.h"
#include "pepeseg/v1/snapshot.pb.h"
#include "server/access/project_quotas.h"
#include "server/api/resource_name.h"
#include "server/residency/memory_budget.h"
#include "server/services/model_devices.h"
#include "server/store/store.h"

namespace pepeseg {

// A model in memory; it stays there for as long as `loaded` is held. `snapshot`: it is the state of
// a job that still trains it; then `name` is the job's, and id.number is 0.
struct ResidentModel {
  const SceneModel& operator*() const { return *loaded; }
  const SceneModel* operator->() const { return &*loaded; }

  std::string name;  // for clients
  ModelCache::Handle loaded;
  SceneChild id;
  std::optional<v1::Snapshot> snapshot = std::nullopt;
};

// Names the model in its answer.
template <class Response>
void SetModel(const ResidentModel& model, Response* response) {
  response->set_model(model.name);
  if (model.snapshot) *response->mutable_snapshot() = *model.snapshot;
}

// A model that may not be in memory yet. The functions are called only if it is not, once for each
// device that is tried.
struct LoadableModel {
  std::string key;      // in the cache
  std::string name;     // for clients
  std::string project;  // in whose share it is counted
  std::function<absl::StatusOr<ModelShape>()> shape;
  std::function<absl::StatusOr<Model>()> read;
};

// Returns FAILED_PRECONDITION for a model that was trained without masks, so has no features.
absl::Status CheckFeatures(const ResidentModel& model);

// Returns the key of a model in the cache.
std::string ResidentKey(const ModelRecord& model);

// Finds the models that requests name, and loads them into memory. Calls with a name check it:
// errors name `field`. Thread safe; all calls block on the store.
class ModelLoader {
 public:
  // All must outlive the loader.
  struct Dependencies {
    std::filesystem::path data_folder;
    Store& store;
    ProjectQuotas& quotas;
  };
  // The backends of `devices`, of which there is at least one, must outlive the loader, too.
  ModelLoader(const Dependencies& deps, std::vector<ModelDevice> devices)
      : deps_(deps), devices_(std::move(devices)) {}

  // Returns the record of a model, where the name ".../models/live" means the live one.
  // FAILED_PRECONDITION: the scene has no model yet; the detail names the scene's active job.
  absl::StatusOr<ModelRecord> Find(const SceneChild& model) const;
  absl::StatusOr<ModelRecord> Find(const NamedScenes& scenes, const std::string& name,
                                   const std::string& field) const;

  // Returns a model in memory, and loads it if necessary, which takes long. UNAVAILABLE with the
  // bytes needed and available, and a time to retry: models in use leave no room for now.
  // RESOURCE_EXHAUSTED: the model cannot fit on any device.
  absl::StatusOr<ResidentModel> Load(const SceneChild& model);
  absl::StatusOr<ResidentModel> Load(const NamedScenes& scenes, const std::string& name,
                                     const std::string& field);
  // Loads a model for a query of its features. In addition to the errors of Load,
  // FAILED_PRECONDITION: see CheckFeatures.
  absl::StatusOr<ResidentModel> LoadWithFeatures(const NamedScenes& scenes, const std::string& name,
                                                 const std::string& field);

  // Returns a model that the store has no record of. Errors are those of Load.
  absl::StatusOr<ModelCache::Handle> Load(const LoadableModel& model);

  // Reserves `bytes` of host memory for an answer about a model of the project, out of the budget
  // and the project's share of its models. RESOURCE_EXHAUSTED or UNAVAILABLE: there is no room.
  absl::StatusOr<std::unique_ptr<ReservedMemory>> TakeAnswerMemory(const std::string& project,
                                                                   int64_t bytes);
  // Reserves memory of host and first device for something that serves all projects, out of the
  // budget only. Errors are those of TakeAnswerMemory.
  absl::StatusOr<std::unique_ptr<ReservedMemory>> TakeServerMemory(const MemoryBytes& bytes);

  Store& store() const { return deps_.store; }
  ModelDevices& devices() { return devices_; }
  const ModelDevices& devices() const { return devices_; }
  const std::filesystem::path& data_folder() const { return deps_.data_folder; }
  // How often feature maps were rendered and found, over all models.
  const MapCounts& map_counts() const { return map_counts_; }

 private:
  absl::StatusOr<ModelRecord> FindLive(const SceneRef& scene) const;
  // Returns the project's share of a device: what its models on other devices leave.
  absl::StatusOr<MemoryShare> ShareOf(const std::string& project, const ModelDevice& device) const;
  // Adds the bytes needed, and available on the largest device, to an error of `devices_`.
  absl::Status WithBytes(const absl::Status& status, const MemoryBytes& need) const;

  const Dependencies deps_;
  MapCounts map_counts_;  // outlives the models in the cache
  ModelDevices devices_;
};

}  // namespace pepeseg
