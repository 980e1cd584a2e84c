#include "server/api/resource_name.h"

#include <algorithm>
#include <charconv>
#include <string>
#include <system_error>
#include <vector>

#include "absl/strings/ascii.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "server/api/error.h"
#include "server/store/scene_key.h"

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

std::vector<std::string> Parts(const std::string& name) {
  // No name of the right form is as long, and the parts of a longer text need not be made.
  if (name.size() > kMaxNameBytes) return {};
  return absl::StrSplit(name, '/');
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

absl::StatusOr<std::string> ParseSceneName(const std::string& name, const std::string& field) {
  const auto parts = Parts(name);
  if (parts.size() != 2 || parts[0] != "scenes" || !IsSceneKey(parts[1])) {
    return BadField(field, name, "not of the form scenes/{scene}");
  }
  return parts[1];
}

absl::StatusOr<SceneChild> ParseChildName(const std::string& name, const std::string& collection,
                                          const std::string& field) {
  const auto parts = Parts(name);
  if (parts.size() != 4 || parts[0] != "scenes" || !IsSceneKey(parts[1]) ||
      parts[2] != collection || ParseNumber(parts[3]) == 0) {
    return BadField(field, name,
                    absl::StrCat("not of the form scenes/{scene}/", collection, "/{number}"));
  }
  return SceneChild{parts[1], ParseNumber(parts[3])};
}

absl::StatusOr<SceneChild> ParseModelName(const std::string& name, const std::string& field) {
  const auto parts = Parts(name);
  if (parts.size() == 4 && parts[0] == "scenes" && IsSceneKey(parts[1]) && parts[2] == "models" &&
      parts[3] == "live") {
    return SceneChild{parts[1], kLiveModel};
  }
  return ParseChildName(name, "models", field);
}

absl::StatusOr<SceneLabel> ParseLabelName(const std::string& name, const std::string& field) {
  const auto parts = Parts(name);
  if (parts.size() != 4 || parts[0] != "scenes" || !IsSceneKey(parts[1]) || parts[2] != "labels" ||
      !IsResourceId(parts[3])) {
    return BadField(field, name, "not of the form scenes/{scene}/labels/{label}");
  }
  return SceneLabel{parts[1], parts[3]};
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

std::string SceneName(const std::string& scene) {
  return absl::StrCat("scenes/", SceneIdOf(scene));
}

std::string ChildName(const std::string& scene, const std::string& collection, int64_t number) {
  return absl::StrCat(SceneName(scene), "/", collection, "/", number);
}

std::string KeyedChildName(const std::string& scene, const std::string& collection,
                           int64_t number) {
  return absl::StrCat("scenes/", scene, "/", collection, "/", number);
}

std::string LabelName(const std::string& scene, const std::string& id) {
  return absl::StrCat(SceneName(scene), "/labels/", id);
}

std::string JobName(const std::string& job) { return absl::StrCat("jobs/", job); }

}  // namespace pepeseg
