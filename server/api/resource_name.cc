#include "server/api/resource_name.h"

#include <algorithm>
#include <charconv>
#include <string>
#include <system_error>
#include <utility>
#include <vector>

#include "absl/strings/ascii.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "server/api/error.h"
#include "server/store/resource_id.h"

namespace pepeseg {
namespace {

constexpr size_t kMaxNameBytes = 256;
constexpr size_t kMaxDisplayNameBytes = 256;

bool AllDigits(std::string_view text) {
  return !text.empty() && std::all_of(text.begin(), text.end(), absl::ascii_isdigit);
}

// Returns the number from 1 that `text` prints without sign and leading zero, or 0 if it is not
// one.
int64_t ParseNumber(std::string_view text) {
  int64_t number = 0;
  // "01" and "+1" are refused, so that each resource has one name, by which quotas, logs and caches
  // know it.
  if (!AllDigits(text) || text[0] == '0') return 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
  // Too many digits for an int64 are an error of from_chars.
  return error == std::errc() && end == text.data() + text.size() ? number : 0;
}

std::vector<std::string> Parts(std::string_view name) {
  // No name of the right form is as long, and the parts of a longer text need not be made.
  if (name.size() > kMaxNameBytes) return {};
  return absl::StrSplit(absl::string_view(name.data(), name.size()), '/');
}

}  // namespace

absl::Status CheckId(const std::string& id, const std::string& field) {
  return IsResourceId(id) ? absl::OkStatus() : BadField(field, id, kResourceIdRule);
}

absl::Status CheckProject(const std::string& id, const std::string& field) {
  if (IsRfc1034Label(id)) return absl::OkStatus();
  return BadField(field, id,
                  "not a lower-case letter, then up to 62 of a-z, 0-9 and '-', not ending in '-'");
}

absl::Status CheckDisplayName(const std::string& name, const std::string& field) {
  if (name.size() <= kMaxDisplayNameBytes) return absl::OkStatus();
  return BadField(field, absl::StrCat(name.size()),
                  absl::StrCat("bytes; allowed are ", kMaxDisplayNameBytes));
}

std::optional<SceneNameParts> SplitSceneName(std::string_view name) {
  std::vector<std::string> parts = Parts(name);
  SceneNameParts split;
  if (parts.size() >= 4 && parts[0] == "projects") {
    if (!IsRfc1034Label(parts[1])) return std::nullopt;
    split.project = std::move(parts[1]);
    parts.erase(parts.begin(), parts.begin() + 2);
  }
  if (parts.size() < 2 || parts[0] != "scenes" || !IsResourceId(parts[1])) return std::nullopt;
  split.name = std::move(parts[1]);
  split.rest.assign(parts.begin() + 2, parts.end());
  return split;
}

void NamedScenes::Add(const SceneNameParts& parts, SceneRef scene) {
  scenes_.insert_or_assign({parts.project, parts.name}, std::move(scene));
}

std::optional<NamedScenes::Found> NamedScenes::Find(const std::string& name) const {
  std::optional<SceneNameParts> parts = SplitSceneName(name);
  if (!parts) return std::nullopt;
  const auto found = scenes_.find({parts->project, parts->name});
  // Not found: the caller must not name a project.
  if (found == scenes_.end()) return std::nullopt;
  return Found{found->second, std::move(parts->rest)};
}

absl::StatusOr<SceneRef> NamedScenes::Scene(const std::string& name,
                                            const std::string& field) const {
  std::optional<Found> found = Find(name);
  if (found && found->rest.empty()) return std::move(found->scene);
  return BadField(field, name, "not of the form scenes/{scene}");
}

absl::StatusOr<SceneChild> NamedScenes::Child(const std::string& name,
                                              const std::string& collection,
                                              const std::string& field) const {
  std::optional<Found> found = Find(name);
  if (found && found->rest.size() == 2 && found->rest[0] == collection &&
      ParseNumber(found->rest[1]) != 0) {
    return SceneChild{std::move(found->scene), ParseNumber(found->rest[1])};
  }
  return BadField(field, name,
                  absl::StrCat("not of the form scenes/{scene}/", collection, "/{number}"));
}

absl::StatusOr<SceneChild> NamedScenes::Model(const std::string& name,
                                              const std::string& field) const {
  std::optional<Found> found = Find(name);
  if (found && found->rest == std::vector<std::string>{"models", "live"}) {
    return SceneChild{std::move(found->scene), kLiveModel};
  }
  return Child(name, "models", field);
}

absl::StatusOr<SceneLabel> NamedScenes::Label(const std::string& name,
                                              const std::string& field) const {
  std::optional<Found> found = Find(name);
  if (found && found->rest.size() == 2 && found->rest[0] == "labels" &&
      IsResourceId(found->rest[1])) {
    return SceneLabel{std::move(found->scene), std::move(found->rest[1])};
  }
  return BadField(field, name, "not of the form scenes/{scene}/labels/{label}");
}

absl::StatusOr<std::string> ParseJobName(const std::string& name, const std::string& field) {
  const auto parts = Parts(name);
  // Job ids name folders under jobs/, so this check also keeps "..", "/" and empty names out of
  // paths.
  if (parts.size() != 2 || parts[0] != "jobs" || parts[1].substr(0, 1) != "j" ||
      ParseNumber(parts[1].substr(1)) == 0) {
    return BadField(field, name, "not of the form jobs/j{number}");
  }
  return parts[1];
}

std::string JobName(const std::string& job) { return absl::StrCat("jobs/", job); }

}  // namespace pepeseg
