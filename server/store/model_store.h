#pragma once

#include <cstdint>
#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "server/store/quota.h"
#include "server/store/records.h"

namespace pepeseg {

class Database;

// Models. JobQueue::CommitModel makes those of trainings. See Store for what holds for all calls.
class ModelStore {
 public:
  ModelStore(Database& database, const Quota& defaults)
      : database_(database), defaults_(defaults) {}

  // Returns a number for a model of the scene, which no other model gets.
  absl::StatusOr<int64_t> TakeModelNumber(const SceneRef& scene);
  // Records a corrected or edited model, which becomes the live one, and returns it with its
  // create_time. NOT_FOUND: the model `made_from` was deleted. RESOURCE_EXHAUSTED: stored_bytes of
  // the project does not allow it.
  absl::StatusOr<ModelRecord> CreateVersion(const ModelRecord& model);

  absl::StatusOr<ModelRecord> GetModel(const SceneRef& scene, int64_t number);
  // Returns the scene's live model, see ModelRecord. FAILED_PRECONDITION: the scene has no model;
  // names the active job.
  absl::StatusOr<ModelRecord> GetLiveModel(const SceneRef& scene);
  // Lists models, newest first.
  absl::StatusOr<Page<ModelRecord>> ListModels(const SceneRef& scene, const PageRequest& page);
  // Makes a model the live one. NOT_FOUND: there is no such model.
  absl::Status SetLiveModel(const SceneRef& scene, int64_t number);
  // Deletes a model with its selections. If it was live, the model that became live last among the
  // others is.
  absl::Status DeleteModel(const SceneRef& scene, int64_t number);

 private:
  Database& database_;
  const Quota& defaults_;  // limits of projects without values of their own
};

}  // namespace pepeseg
