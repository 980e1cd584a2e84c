#include "server/access/scene_names.h"

#include <string>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "absl/strings/str_split.h"
#include "core/base/status_macros.h"
#include "server/access/method_access.h"
#include "server/store/error_detail.h"
#include "server/store/scene_key.h"

namespace pepeseg {
namespace {

// The parts of a name "scenes/{scene}/...", which "projects/{project}/" may precede.
struct NamedScene {
  std::string project;  // empty: not given
  std::string id;
  std::vector<std::string> rest;  // after the scene
};

absl::Status WithField(absl::Status status, const std::string& reason, const std::string& field) {
  return WithDetail(std::move(status), {.reason = reason, .field = field});
}

// Splits a name. Returns false if it does not begin with a scene, as the name of a job or a bare
// label; such names are left to the handler. INVALID_ARGUMENT: it contains a scene's key instead of
// an id, which clients must not use.
absl::StatusOr<bool> Split(const std::string& name, const NamedResource& resource,
                           bool may_say_project, NamedScene& split) {
  std::vector<std::string> parts = absl::StrSplit(name, '/');
  // Only callers who see all projects may name one; the others have that of their key.
  if (may_say_project && parts.size() >= 4 && parts[0] == "projects") {
    split.project = parts[1];
    parts.erase(parts.begin(), parts.begin() + 2);
  }
  const bool is_scene = parts.size() >= 2 && parts[0] == "scenes";
  if (is_scene && IsResourceId(parts[1]) &&
      (split.project.empty() || IsRfc1034Label(split.project))) {
    split.id = parts[1];
    split.rest.assign(parts.begin() + 2, parts.end());
    return true;
  }
  if (split.project.empty() && (!is_scene || !IsSceneKey(parts[1]))) return false;
  return WithField(
      absl::InvalidArgumentError(absl::StrCat(resource.field, ": not the name of a scene's")),
      "BAD_FIELD", resource.field);
}

std::string Join(const std::string& key, const std::vector<std::string>& rest) {
  std::string name = absl::StrCat("scenes/", key);
  for (const std::string& part : rest) absl::StrAppend(&name, "/", part);
  return name;
}

absl::StatusOr<std::string> OrNoKey(absl::StatusOr<std::string> key, const std::string& id) {
  // A key that no scene has, so that the handler reports NOT_FOUND in its own words and with its
  // own detail.
  if (absl::IsNotFound(key.status())) return NoSceneKey(id);
  return key;
}

// Returns the key for a caller who sees all projects and does not name one.
absl::StatusOr<std::string> OnlyKey(Store& store, const std::string& id, const std::string& field) {
  // The default project first, so that another project cannot change what a name means there.
  absl::StatusOr<std::string> of_default = store.scenes().FindScene(kDefaultProject, id);
  if (!absl::IsNotFound(of_default.status())) return of_default;
  ASSIGN_OR_RETURN(const std::vector<SceneRow> scenes, store.scenes().FindScenes(id));
  if (scenes.empty()) return NoSceneKey(id);
  if (scenes.size() == 1) return scenes[0].key;
  std::vector<std::string> projects;
  for (const SceneRow& scene : scenes) projects.push_back(scene.project);
  return WithField(
      absl::FailedPreconditionError(absl::StrCat(
          field, ": scenes/", id, " is in the projects ", absl::StrJoin(projects, ", "),
          ": name one of them, as projects/", projects[0], "/scenes/", id)),
      "AMBIGUOUS_SCENE", field);
}

absl::StatusOr<std::string> Resolve(Store& store, const Caller& caller,
                                    const NamedResource& resource) {
  NamedScene name;
  ASSIGN_OR_RETURN(const bool is_scene,
                   Split(resource.name, resource, caller.sees_all_projects, name));
  if (!is_scene) return resource.name;
  std::string key;
  if (caller.sees_all_projects && name.project.empty()) {
    ASSIGN_OR_RETURN(key, OnlyKey(store, name.id, resource.field));
  } else {
    const std::string& project = name.project.empty() ? caller.project : name.project;
    ASSIGN_OR_RETURN(key, OrNoKey(store.scenes().FindScene(project, name.id), name.id));
  }
  return Join(key, name.rest);
}

}  // namespace

absl::Status ResolveSceneNames(Store& store, const Caller& caller,
                               google::protobuf::Message& request) {
  const MethodAccess* access = FindMethodAccess(*request.GetDescriptor());
  if (access == nullptr) return absl::OkStatus();
  for (const NamedResource& resource : ResourcesOf(*access, request)) {
    ASSIGN_OR_RETURN(const std::string name, Resolve(store, caller, resource));
    // Handlers see keys from here on. A request must be resolved once only: a key is refused as a
    // name.
    if (name != resource.name) SetResource(*access, resource.field, name, request);
  }
  return absl::OkStatus();
}

absl::StatusOr<std::string> ResolveOperatorsName(Store& store, const std::string& name,
                                                 const std::string& field) {
  Caller caller;
  caller.sees_all_projects = true;
  return Resolve(store, caller, {field, name});
}

}  // namespace pepeseg
