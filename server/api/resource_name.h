#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "absl/status/statusor.h"
#include "server/store/scene_ref.h"

// Reads resource names. The functions that read one return INVALID_ARGUMENT, which names `field`,
// for anything that is not exactly of the form.
namespace pepeseg {

inline constexpr int64_t kLiveModel = 0;

// A numbered child of a scene.
struct SceneChild {
  SceneRef scene;
  int64_t number = 0;
};

// A label of a scene.
struct SceneLabel {
  SceneRef scene;
  std::string id;
};

// Returns INVALID_ARGUMENT unless the id of a scene or label is valid (IsResourceId).
absl::Status CheckId(const std::string& id, const std::string& field);
// Returns INVALID_ARGUMENT unless the id of a project is an RFC 1034 label.
absl::Status CheckProject(const std::string& id, const std::string& field);
// Returns INVALID_ARGUMENT for a name of more than 256 bytes.
absl::Status CheckDisplayName(const std::string& name, const std::string& field);

// A resource name of a scene or of something in it, taken apart.
struct SceneNameParts {
  std::string project;            // of "projects/{project}/" before the scene; empty: not given
  std::string name;               // of the scene
  std::vector<std::string> rest;  // what follows the scene
};
// Returns the parts of "[projects/{project}/]scenes/{scene}[/...]", or nullopt if a name has
// another form, as that of a job.
std::optional<SceneNameParts> SplitSceneName(std::string_view name);

// The scenes that the resource names of a request mean. They were resolved once, when the call was
// authorised (server/access/scene_names.h); handlers read the names of their requests by it.
class NamedScenes {
 public:
  // Adds what the scene in `parts` was resolved to.
  void Add(const SceneNameParts& parts, SceneRef scene);

  // Reads "scenes/{scene}".
  absl::StatusOr<SceneRef> Scene(const std::string& name, const std::string& field) const;
  // Reads "scenes/{scene}/COLLECTION/{number}" with a number from 1.
  absl::StatusOr<SceneChild> Child(const std::string& name, const std::string& collection,
                                   const std::string& field) const;
  // Reads "scenes/{scene}/models/{number}", where the number may be "live": kLiveModel.
  absl::StatusOr<SceneChild> Model(const std::string& name, const std::string& field) const;
  // Reads "scenes/{scene}/labels/{label}".
  absl::StatusOr<SceneLabel> Label(const std::string& name, const std::string& field) const;

 private:
  // Returns the scene and the parts after it.
  struct Found {
    SceneRef scene;
    std::vector<std::string> rest;
  };
  std::optional<Found> Find(const std::string& name) const;

  std::map<std::pair<std::string, std::string>, SceneRef>
      scenes_;  // by project, as given, and name
};

// Parses "jobs/{job}"; returns the id, which is "j" and digits.
absl::StatusOr<std::string> ParseJobName(const std::string& name, const std::string& field);
std::string JobName(const std::string& job);

}  // namespace pepeseg
