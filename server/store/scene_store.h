#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "server/store/records.h"

namespace pepeseg {

class Database;

// Scenes. See Store for what holds for all calls. Clients name a scene by its name within a
// project, and all calls but those that find it by its SceneRef.
class SceneStore {
 public:
  explicit SceneStore(Database& database) : database_(database) {}

  // Creates a scene from project and name of `scene`, display_name and request_id, which is unique
  // within the project. INVALID_ARGUMENT: the name is not IsResourceId, or the project is not an
  // RFC 1034 label. ALREADY_EXISTS: a scene of the project has the name.
  absl::StatusOr<SceneRecord> CreateScene(const SceneRecord& scene);
  // NOT_FOUND: the project has no scene with this name, even if others have.
  absl::StatusOr<SceneRef> FindScene(const std::string& project, const std::string& name);
  // Returns up to ten scenes with this name in all projects, ordered by project.
  absl::StatusOr<std::vector<SceneRef>> FindScenes(const std::string& name);
  // Returns the scene with the id of `scene`.
  absl::StatusOr<SceneRecord> GetScene(const SceneRef& scene);
  // Lists scenes by name. `project`: empty for all projects.
  absl::StatusOr<Page<SceneRecord>> ListScenes(const PageRequest& page,
                                               const std::string& project = "");
  // Deletes a scene with all that belongs to it. FAILED_PRECONDITION: a job of it is active.
  absl::Status DeleteScene(const SceneRef& scene);

 private:
  Database& database_;
};

}  // namespace pepeseg
