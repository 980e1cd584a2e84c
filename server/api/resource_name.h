#pragma once

#include <cstdint>
#include <string>

#include "absl/status/statusor.h"

// Resource names. Requests have scenes' keys in the place of their ids when they get to a handler
// (see server/access/scene_names.h), so parsing answers keys, and `scene` is one in all that is
// here; names that are made here are for clients and have ids. Parsing answers INVALID_ARGUMENT,
// naming `field`, for anything that is not exactly of the form.
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

// INVALID_ARGUMENT unless the id of a scene or a label is IsResourceId.
absl::Status CheckId(const std::string& id, const std::string& field);
// INVALID_ARGUMENT unless it is an RFC 1034 label.
absl::Status CheckProject(const std::string& id, const std::string& field);
// INVALID_ARGUMENT beyond 256 bytes.
absl::Status CheckDisplayName(const std::string& name, const std::string& field);

// "scenes/{scene}": the scene's id.
absl::StatusOr<std::string> ParseSceneName(const std::string& name, const std::string& field);
// "scenes/{scene}/COLLECTION/{number}", the number from 1.
absl::StatusOr<SceneChild> ParseChildName(const std::string& name, const std::string& collection,
                                          const std::string& field);
// As above for "models", where "live" is kLiveModel.
absl::StatusOr<SceneChild> ParseModelName(const std::string& name, const std::string& field);
// "scenes/{scene}/labels/{label}".
absl::StatusOr<SceneLabel> ParseLabelName(const std::string& name, const std::string& field);
// "jobs/{job}": the job's id, "j" and digits.
absl::StatusOr<std::string> ParseJobName(const std::string& name, const std::string& field);

std::string SceneName(const std::string& scene);
std::string ChildName(const std::string& scene, const std::string& collection, int64_t number);
// As ChildName, with the scene's key: to be parsed here again.
std::string KeyedChildName(const std::string& scene, const std::string& collection, int64_t number);
std::string LabelName(const std::string& scene, const std::string& id);
std::string JobName(const std::string& job);

}  // namespace pepeseg
