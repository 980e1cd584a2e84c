#include "core/base/file_name.h"
#include "core/dataset/import.h"
#include "server/access/api_key.h"
#include "server/api/resource_name.h"
#include "server/services/upload_rules.h"
#include "server/store/resource_id.h"
#include "server/store/store_sql.h"
#include "tests/system/fuzz/fuzz_target.h"

namespace {

void ReadResourceNames(const std::string& text) {
  using pepeseg::fuzz::Expect;
  if (const auto parts = pepeseg::SplitSceneName(text); parts.has_value()) {
    const pepeseg::SceneRef scene{1, parts->project, parts->name};
    Expect(pepeseg::IsResourceId(scene.name), "an id that is no path");
    pepeseg::NamedScenes scenes;
    scenes.Add(*parts, scene);
    const std::string project = parts->project.empty() ? "" : "projects/" + parts->project + "/";
    if (const auto read = scenes.Scene(text, "name"); read.ok()) {
      Expect(project + pepeseg::SceneName(*read) == text, "the same scene");
    }
    if (const auto model = scenes.Model(text, "name"); model.ok()) {
      Expect(model->number >= pepeseg::kLiveModel, "a number");
    }
    if (const auto child = scenes.Child(text, "datasets", "name"); child.ok()) {
      Expect(project + pepeseg::ChildName(child->scene, "datasets", child->number) == text,
             "the same child");
    }
    if (const auto label = scenes.Label(text, "name"); label.ok()) {
      Expect(project + pepeseg::LabelName(label->scene, label->id) == text, "the same label");
    }
  }
  if (const auto job = pepeseg::ParseJobName(text, "name"); job.ok()) {
    Expect(pepeseg::JobName(*job) == text, "the same job");
  }
}

}  // namespace

// Parses the bytes as a path of an upload, a resource name, a page token, scopes and a secret.
PEPESEG_FUZZ_TARGET(names) {
  using pepeseg::fuzz::Expect;
  const std::string text(bytes);
  if (pepeseg::CheckUploadPath(text, "path").ok()) {
    Expect(pepeseg::ValidateName(text).ok(),
           "a path that may be uploaded to be one for the worker");
    Expect(text.front() != '/' && text.find("/../") == std::string::npos, "a relative path");
  }
  (void)pepeseg::WithoutFolder(text, "images");
  (void)pepeseg::WithoutSuffix(text);
  (void)pepeseg::Suffix(text);
  ReadResourceNames(text);
  const auto start = pepeseg::StartPage("scenes", {0, text});
  if (start.ok()) (void)pepeseg::NumberKey(*start, 0);
  (void)pepeseg::OfProject(text);
  const auto scopes = pepeseg::ScopesFromText(text);
  if (scopes.ok()) (void)pepeseg::ScopesToText(*scopes);
  (void)pepeseg::LooksLikeSecret(text);
}
