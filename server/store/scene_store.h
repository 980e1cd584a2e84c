#pragma once

#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "server/store/rows.h"

namespace pepeseg {

class Database;

// Scenes. See Store for what holds for all calls. Clients name a scene by its id within a project;
// all calls but CreateScene, FindScene and FindScenes name it by its key (scene_key.h).
class SceneStore {
 public:
  explicit SceneStore(Database& database) : database_(database) {}

  // Creates a scene from `id`, `display_name`, `request_id` (unique within the project) and
  // `project`. INVALID_ARGUMENT: the id is not IsResourceId, or the project is not an RFC 1034
  // label. ALREADY_EXISTS: a scene of the project has the id.
  absl::StatusOr<SceneRow> CreateScene(const SceneRow& scene);
  // Returns a scene's key. NOT_FOUND: the project has no scene with this id, even if others have.
  absl::StatusOr<std::string> FindScene(const std::string& project, const std::string& id);
  // Returns up to ten scenes with this id in all projects, ordered by project.
  absl::StatusOr<std::vector<SceneRow>> FindScenes(const std::string& id);
  absl::StatusOr<SceneRow> GetScene(const std::string& key);
  // Lists scenes by id. `project`: empty for all projects.
  absl::StatusOr<Page<SceneRow>> ListScenes(const PageRequest& page,
                                            const std::string& project = "");
  // Deletes a scene with all that belongs to it. FAILED_PRECONDITION: a job of it is active.
  absl::Status DeleteScene(const std::string& key);
  // Returns the project of a scene. NOT_FOUND: there is no such scene. INVALID_ARGUMENT: no scene
  // can have this key.
  absl::StatusOr<std::string> ProjectOfScene(const std::string& key);

 private:
  Database& database_;
};

}  // namespace pepeseg
