#include "clients/cpp/resource_names.h"

#include <random>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"

namespace pepeseg::client {

std::string SceneName(const std::string& scene) {
  // A scene may be given by its id alone.
  const bool is_name = absl::StartsWith(scene, "scenes/") || absl::StartsWith(scene, "projects/");
  return is_name ? scene : absl::StrCat("scenes/", scene);
}

std::string JobName(const std::string& job) {
  return absl::StartsWith(job, "jobs/") ? job : absl::StrCat("jobs/", job);
}

std::string ModelName(const std::string& scene, const std::string& model) {
  if (absl::StartsWith(model, "jobs/")) return model;
  return absl::StrCat(SceneName(scene), "/models/", model);
}

std::string SceneOf(const std::string& resource) {
  // The name may begin with "projects/lab/", so look for the '/' after the id of the scene.
  const std::string scenes = "scenes/";
  const size_t begin = resource.find(scenes);
  if (begin == std::string::npos) return "";
  return resource.substr(0, resource.find('/', begin + scenes.size()));
}

std::string NewRequestId() {
  std::random_device random;
  std::string id;
  // 4 words of 32 bits.
  for (int word = 0; word < 4; ++word) absl::StrAppendFormat(&id, "%08x", random());
  return id;
}

}  // namespace pepeseg::client
