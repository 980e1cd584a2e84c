#pragma once

#include <cstdint>
#include <string>

#include "absl/status/statusor.h"

// Parses and makes resource names. When a request reaches its handler, its scenes' ids have been
// replaced by keys (server/access/scene_names.h): the parsers return keys, and `scene` is a key
// everywhere in this file. Names that are made are for clients and have ids, except for
// KeyedChildName. The parsers return INVALID_ARGUMENT, which names `field`, for anything that is
// not exactly of the form.
namespace pepeseg {

inline constexpr int64_t kLiveModel = 0;

// A numbered child of a scene.
struct SceneChild {
  std::string scene;
  int64_t number = 0;
};

// A label of a scene.
struct SceneLabel {
  std::string scene;
  std::string id;
};

// Returns INVALID_ARGUMENT unless the id of a scene or label is valid (IsResourceId).
absl::Status CheckId(const std::string& id, const std::string& field);
// Returns INVALID_ARGUMENT unless the id of a project is an RFC 1034 label.
absl::Status CheckProject(const std::string& id, const std::string& field);
// Returns INVALID_ARGUMENT for a name of more than 256 bytes.
absl::Status CheckDisplayName(const std::string& name, const std::string& field);

// Parses "scenes/{scene}"; returns the scene.
absl::StatusOr<std::string> ParseSceneName(const std::string& name, const std::string& field);
// Parses "scenes/{scene}/COLLECTION/{number}" with a number from 1.
absl::StatusOr<SceneChild> ParseChildName(const std::string& name, const std::string& collection,
                                          const std::string& field);
// Parses "scenes/{scene}/models/{number}", where the number may be "live": kLiveModel.
absl::StatusOr<SceneChild> ParseModelName(const std::string& name, const std::string& field);
// Parses "scenes/{scene}/labels/{label}".
absl::StatusOr<SceneLabel> ParseLabelName(const std::string& name, const std::string& field);
// Parses "jobs/{job}"; returns the id, which is "j" and digits.
absl::StatusOr<std::string> ParseJobName(const std::string& name, const std::string& field);

std::string SceneName(const std::string& scene);
std::string ChildName(const std::string& scene, const std::string& collection, int64_t number);
// Returns the name with the scene's key instead of its id, for ParseChildName.
std::string KeyedChildName(const std::string& scene, const std::string& collection, int64_t number);
std::string LabelName(const std::string& scene, const std::string& id);
std::string JobName(const std::string& job);

}  // namespace pepeseg
