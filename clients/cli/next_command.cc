#include "clients/cli/next_command.h"

#include <algorithm>
#include <cstdlib>

#include "absl/strings/ascii.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_replace.h"
#include "clients/cli/pixel_frame.h"
#include "clients/cpp/resource_names.h"

namespace pepeseg::client::cli {
namespace {

std::string Quoted(const std::string& word) {
  const bool plain = !word.empty() && std::all_of(word.begin(), word.end(), [](unsigned char c) {
    return absl::ascii_isalnum(c) || std::string("_-./,:=@+%").find(c) != std::string::npos;
  });
  if (plain) return word;
  return absl::StrCat("'", absl::StrReplaceAll(word, {{"'", "'\\''"}}), "'");
}

bool IsNamedByEnvironment(const std::string& server) {
  const char* named = std::getenv("PEPESEG_SERVER");
  return server == (named == nullptr ? Shell().server : named);
}

// Returns the middle one of the views that were trained on or, without any, of all views.
const v1::View& MiddleView(const std::vector<v1::View>& views) {
  std::vector<const v1::View*> trained;
  for (const v1::View& view : views) {
    if (!view.held_out()) trained.push_back(&view);
  }
  return trained.empty() ? views[views.size() / 2] : *trained[trained.size() / 2];
}

}  // namespace

std::string CommandText(const Shell& shell, const std::vector<std::string>& words) {
  std::string text = Quoted(shell.program);
  for (const std::string& word : words) absl::StrAppend(&text, " ", Quoted(word));
  if (!IsNamedByEnvironment(shell.server)) absl::StrAppend(&text, " --server ", shell.server);
  return text;
}

std::string FirstQuestion(const Shell& shell, const v1::Model& model,
                          const std::vector<v1::View>& views) {
  const std::string scene = SceneOf(model.name()).substr(std::string("scenes/").size());
  const auto masks = model.sources().find("masks");
  const bool segments = masks == model.sources().end() || masks->second != "none";
  if (!segments || views.empty()) {
    return CommandText(shell, {"export", scene, absl::StrCat(scene, ".ply")});
  }
  const v1::View& view = MiddleView(views);
  const auto [width, height] = PhotographSize(view);
  return CommandText(
      shell, {"segment", scene, "--view", view.view(), "--point",
              absl::StrCat(width / 2, ",", height / 2), "--views", "all", "--out", "masks"});
}

}  // namespace pepeseg::client::cli
