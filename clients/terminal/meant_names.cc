#include "clients/terminal/meant_names.h"

#include <algorithm>
#include <optional>
#include <vector>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/string_view.h"
#include "clients/cpp/answer_status.h"
#include "clients/cpp/nearest_names.h"
#include "clients/cpp/resource_names.h"

namespace pepeseg::client::cli {
namespace {

// Returns the id of a scene: "shelf" for "scenes/shelf/models/live"; "" for another resource.
std::string SceneId(const std::string& resource) {
  const std::string name = SceneOf(resource);
  return name.empty() ? "" : name.substr(name.rfind('/') + 1);
}

// Returns a name that the error quotes as that of a view; "" if it is about something else.
std::string UnknownView(const absl::Status& status, const ErrorDetail& detail) {
  if (absl::IsInvalidArgument(status) &&
      absl::StrContains(status.message(), "not a view of the model")) {
    return detail.value;
  }
  constexpr absl::string_view kPhotograph = "photograph \"";
  const absl::string_view message = status.message();
  if (detail.reason != "NO_SUCH_PHOTOGRAPH" || !absl::StartsWith(message, kPhotograph)) return "";
  const absl::string_view name = message.substr(kPhotograph.size());
  return std::string(name.substr(0, name.find('"')));
}

std::vector<std::string> SceneIds(const Client& client) {
  std::vector<std::string> ids;
  const auto scenes = client.ListScenes();
  if (!scenes.ok()) return ids;
  for (const v1::Scene& scene : scenes->scenes()) ids.push_back(SceneId(scene.name()));
  return ids;
}

std::vector<std::string> ViewNames(const Client& client, const NamedModel& named) {
  std::vector<std::string> names;
  const auto views = client.ListViews(ModelName(named.scene, named.model));
  if (!views.ok()) return names;
  for (const v1::View& view : *views) names.push_back(view.view());
  return names;
}

}  // namespace

absl::Status WithNearestNames(const Client& client, const NamedModel& named, absl::Status status) {
  const std::optional<ErrorDetail> detail = DetailOf(status);
  if (!detail) return status;
  std::vector<std::string> names;
  std::string word = UnknownView(status, *detail);
  if (!word.empty() && !named.scene.empty()) {
    names = ViewNames(client, named);
  } else if (absl::IsNotFound(status)) {
    word = SceneId(detail->resource);
    if (!word.empty()) names = SceneIds(client);
  }
  // A name that exists is not what is missing.
  if (std::find(names.begin(), names.end(), word) != names.end()) return status;
  const std::string meant = DidYouMean(NearestNames(word, names));
  if (meant.empty()) return status;
  absl::Status longer(status.code(), absl::StrCat(status.message(), meant));
  status.ForEachPayload(
      [&](absl::string_view url, const absl::Cord& payload) { longer.SetPayload(url, payload); });
  return longer;
}

}  // namespace pepeseg::client::cli
