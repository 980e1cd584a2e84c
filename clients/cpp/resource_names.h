#pragma once

#include <string>

namespace pepeseg::client {

// Returns the resource name of a scene: "scenes/shelf" for "shelf" and "scenes/shelf". A name such
// as "projects/lab/scenes/shelf" is returned as it is: operators, and callers of servers without
// keys, use it for the scene of a project.
std::string SceneName(const std::string& scene);
// Returns the resource name of a job: "jobs/j1" for "j1" and "jobs/j1".
std::string JobName(const std::string& job);
// Returns the resource name of a model of a scene, which is given by id or name. `model` is a
// number, or "live" for the live model. The name of a job, "jobs/j1", which queries take in place
// of a model's, is returned as it is.
std::string ModelName(const std::string& scene, const std::string& model = "live");

// Returns the scene that a resource belongs to: "scenes/shelf" for "scenes/shelf/models/3". Empty:
// the name has none, as that of a job.
std::string SceneOf(const std::string& resource);

// Returns a random request_id of 32 hex digits, by which the server recognises a call that is
// repeated after a lost answer.
std::string NewRequestId();

}  // namespace pepeseg::client
