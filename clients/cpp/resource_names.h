#pragma once

#include <string>

namespace pepeseg::client {

// "shelf" or "scenes/shelf" -> "scenes/shelf". "projects/lab/scenes/shelf" stays as it is:
// operators, and callers of servers without keys, name a project's scene so.
std::string SceneName(const std::string& scene);
// "j1" or "jobs/j1" -> "jobs/j1".
std::string JobName(const std::string& job);
// Of a scene's id or name; `model` is a number, or "live" for the newest.
std::string ModelName(const std::string& scene, const std::string& model = "live");

// "scenes/shelf/models/3" -> "scenes/shelf".
std::string SceneOf(const std::string& resource);

// Random, so that a call repeated after a lost answer is known for the same one.
std::string NewRequestId();

}  // namespace pepeseg::client
