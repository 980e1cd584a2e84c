#include "core/base/file_name.h"
#include "core/dataset/import.h"
#include "server/access/api_key.h"
#include "server/api/resource_name.h"
#include "server/services/upload_rules.h"
#include "server/store/scene_key.h"
#include "server/store/store_sql.h"
#include "tests/system/fuzz/fuzz_target.h"

namespace {

void ReadResourceNames(const std::string& text) {
  using pepeseg::fuzz::Expect;
  if (const auto scene = pepeseg::ParseSceneName(text, "name"); scene.ok()) {
    Expect("scenes/" + *scene == text && pepeseg::IsSceneKey(*scene), "the same scene");
    Expect(scene->find_first_of("/'%\\") == std::string::npos && scene->front() != '.',
           "a scene that is no path");
  }
  if (const auto model = pepeseg::ParseModelName(text, "name"); model.ok()) {
    Expect(model->number >= pepeseg::kLiveModel, "a number");
  }
  if (const auto child = pepeseg::ParseChildName(text, "datasets", "name"); child.ok()) {
    Expect(pepeseg::KeyedChildName(child->scene, "datasets", child->number) == text,
           "the same child");
  }
  if (const auto label = pepeseg::ParseLabelName(text, "name"); label.ok()) {
    Expect("scenes/" + label->scene + "/labels/" + label->id == text, "the same label");
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
