#pragma once

#include <cstdint>
#include <string>

namespace pepeseg {

// A scene, resolved once for each call from the name that the client used
// (server/access/scene_names.h). The store finds a scene by `id` alone.
struct SceneRef {
  int64_t id = 0;       // in the database, from 1, never reused; 0: no scene has this name
  std::string project;  // RFC 1034 label
  std::string name;     // the id that clients chose, IsResourceId; unique within the project

  bool operator==(const SceneRef&) const = default;
};

// Return the names of resources, as clients read them: "scenes/{scene}",
// "scenes/{scene}/COLLECTION/{number}" and "scenes/{scene}/labels/{label}".
std::string SceneName(const SceneRef& scene);
std::string ChildName(const SceneRef& scene, const std::string& collection, int64_t number);
std::string LabelName(const SceneRef& scene, const std::string& label);

}  // namespace pepeseg
