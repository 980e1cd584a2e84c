#pragma once

#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "server/store/records.h"

namespace pepeseg {

class Database;

// Labels of a scene. See Store for what holds for all calls.
class LabelStore {
 public:
  explicit LabelStore(Database& database) : database_(database) {}

  // Creates a label from all fields but create_time; checks the id only. INVALID_ARGUMENT: the id
  // is not IsResourceId. ALREADY_EXISTS: a label of another request has the id.
  absl::StatusOr<LabelRecord> CreateLabel(const LabelRecord& label);
  // NOT_FOUND also names up to 20 labels of the scene.
  absl::StatusOr<LabelRecord> GetLabel(const SceneRef& scene, const std::string& id);
  // Lists labels by id.
  absl::StatusOr<Page<LabelRecord>> ListLabels(const SceneRef& scene, const PageRequest& page);
  absl::Status DeleteLabel(const SceneRef& scene, const std::string& id);

 private:
  Database& database_;
};

}  // namespace pepeseg
