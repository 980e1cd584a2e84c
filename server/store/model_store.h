#pragma once

#include <cstdint>
#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "server/store/records.h"

namespace pepeseg {

class Database;

// Models. JobQueue::CommitModel makes them. See Store for what holds for all calls.
class ModelStore {
 public:
  explicit ModelStore(Database& database) : database_(database) {}

  absl::StatusOr<ModelRecord> GetModel(const SceneRef& scene, int64_t number);
  // Returns the scene's newest model. FAILED_PRECONDITION: there is none; names the active job.
  absl::StatusOr<ModelRecord> GetLiveModel(const SceneRef& scene);
  // Lists models, newest first.
  absl::StatusOr<Page<ModelRecord>> ListModels(const SceneRef& scene, const PageRequest& page);
  // Deletes a model with its selections.
  absl::Status DeleteModel(const SceneRef& scene, int64_t number);

 private:
  Database& database_;
};

}  // namespace pepeseg
