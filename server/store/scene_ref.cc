#include "server/store/scene_ref.h"

#include "absl/strings/str_cat.h"

namespace pepeseg {

std::string SceneName(const SceneRef& scene) { return absl::StrCat("scenes/", scene.name); }

std::string ChildName(const SceneRef& scene, const std::string& collection, int64_t number) {
  return absl::StrCat(SceneName(scene), "/", collection, "/", number);
}

std::string LabelName(const SceneRef& scene, const std::string& label) {
  return absl::StrCat(SceneName(scene), "/labels/", label);
}

}  // namespace pepeseg
