#include "server/access/scene_names.h"

#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "core/base/status_macros.h"
#include "server/access/method_access.h"
#include "server/store/error_detail.h"

namespace pepeseg {

// The message does not contain the name, and is the same for a resource of another project and for
// one that does not exist, so that nobody learns which names others use.
absl::Status NotYoursError(const std::string& field) {
  return WithDetail(absl::PermissionDeniedError(
                        absl::StrCat(field, ": nothing of the key's project has this name")),
                    {.reason = "NOT_YOURS", .field = field});
}

namespace {

// Returns the scene of this name, with the id 0 if the project has none.
absl::StatusOr<SceneRef> FindOrNone(Store& store, const std::string& project,
                                    const std::string& name) {
  absl::StatusOr<SceneRef> scene = store.scenes().FindScene(project, name);
  if (absl::IsNotFound(scene.status())) return SceneRef{0, project, name};
  return scene;
}

// Returns the scene for a caller who sees all projects and does not name one.
absl::StatusOr<SceneRef> FindOnly(Store& store, const std::string& name, const std::string& field) {
  // The default project first, so that another project cannot change what a name means there.
  ASSIGN_OR_RETURN(const SceneRef of_default, FindOrNone(store, kDefaultProject, name));
  if (of_default.id != 0) return of_default;
  ASSIGN_OR_RETURN(const std::vector<SceneRef> scenes, store.scenes().FindScenes(name));
  if (scenes.empty()) return of_default;
  if (scenes.size() == 1) return scenes[0];
  std::vector<std::string> projects;
  projects.reserve(scenes.size());
  for (const SceneRef& scene : scenes) projects.push_back(scene.project);
  return WithDetail(
      absl::FailedPreconditionError(absl::StrCat(
          field, ": scenes/", name, " is in the projects ", absl::StrJoin(projects, ", "),
          ": name one of them, as projects/", projects[0], "/scenes/", name)),
      {.reason = "AMBIGUOUS_SCENE", .field = field});
}

// Adds the scene of a resource to `scenes`. Names without a scene, and those that the caller may
// not use, are left to the handler, which refuses them.
absl::Status Resolve(Store& store, const Caller& caller, const NamedResource& resource,
                     NamedScenes& scenes) {
  const std::optional<SceneNameParts> parts = SplitSceneName(resource.name);
  // Only callers who see all projects may name one; the others have that of their key.
  if (!parts || (!parts->project.empty() && !caller.sees_all_projects)) return absl::OkStatus();
  SceneRef scene;
  if (caller.sees_all_projects && parts->project.empty()) {
    ASSIGN_OR_RETURN(scene, FindOnly(store, parts->name, resource.field));
  } else {
    const std::string& project = parts->project.empty() ? caller.project : parts->project;
    ASSIGN_OR_RETURN(scene, FindOrNone(store, project, parts->name));
    if (scene.id == 0 && !caller.sees_all_projects) return NotYoursError(resource.field);
  }
  scenes.Add(*parts, std::move(scene));
  return absl::OkStatus();
}

}  // namespace

absl::StatusOr<NamedScenes> ResolveSceneNames(Store& store, const Caller& caller,
                                              const google::protobuf::Message& request) {
  NamedScenes scenes;
  const MethodAccess* access = FindMethodAccess(*request.GetDescriptor());
  if (access == nullptr) return scenes;
  for (const NamedResource& resource : ResourcesOf(*access, request)) {
    RETURN_IF_ERROR(Resolve(store, caller, resource, scenes));
  }
  return scenes;
}

absl::StatusOr<NamedScenes> ResolveOperatorsName(Store& store, const std::string& name,
                                                 const std::string& field) {
  Caller caller;
  caller.sees_all_projects = true;
  NamedScenes scenes;
  RETURN_IF_ERROR(Resolve(store, caller, {field, name}, scenes));
  return scenes;
}

}  // namespace pepeseg
