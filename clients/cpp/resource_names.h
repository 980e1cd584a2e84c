#pragma once

#include <string>

namespace pepeseg::client {

// "shelf" or "scenes/shelf" -> "scenes/shelf"; likewise jobs. "projects/lab/scenes/shelf", which
// names a project's scene to operators and to servers without keys, stays as it is.
std::string SceneName(const std::string& scene);
std::string JobName(const std::string& job);
// Of a scene's id or name; `model` is a number, or "live" for the newest.
std::string ModelName(const std::string& scene, const std::string& model = "live");

// "scenes/shelf/models/3" -> "scenes/shelf".
std::string SceneOf(const std::string& resource);

// Random, so that a call repeated after a lost answer is known for the same one.
std::string NewRequestId();

}  // namespace pepeseg::client
