#pragma once

#include <string>
#include <utility>

#include "server/store/store.h"

namespace pepeseg {

// Returns the record of a scene to create.
inline SceneRecord NewScene(const std::string& name, const std::string& display_name = "",
                            const std::string& request_id = "",
                            const std::string& project = kDefaultProject) {
  return {{0, project, name}, display_name, request_id, {}};
}

// Returns the scene of this name in the first project that has one, or a scene that does not exist.
inline SceneRef SceneOf(Store& store, const std::string& name) {
  const auto found = store.scenes().FindScenes(name);
  return found.ok() && !found->empty() ? found->front() : SceneRef{0, kDefaultProject, name};
}

}  // namespace pepeseg
