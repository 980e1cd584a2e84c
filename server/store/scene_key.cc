#include "server/store/scene_key.h"

#include <algorithm>

#include "absl/strings/ascii.h"
#include "server/store/id_rules.h"

namespace pepeseg {
namespace {

constexpr char kEndOfNumber = '@';

// Bytes of "NUMBER@" at the start of `text`; 0: there is none.
size_t PrefixLength(std::string_view text) {
  const auto end = std::find_if_not(text.begin(), text.end(), absl::ascii_isdigit);
  if (end == text.begin() || end == text.end() || *end != kEndOfNumber) return 0;
  return static_cast<size_t>(end - text.begin()) + 1;
}

}  // namespace

std::string MakeSceneKey(int64_t number, std::string_view id) {
  return std::to_string(number) + kEndOfNumber + std::string(id);
}

bool IsSceneKey(std::string_view text) { return IsResourceId(text.substr(PrefixLength(text))); }

std::string SceneIdOf(std::string_view key) { return std::string(key.substr(PrefixLength(key))); }

std::string NoSceneKey(std::string_view id) { return MakeSceneKey(0, id); }

std::string WithSceneIds(std::string_view text) {
  constexpr std::string_view kScenes = "scenes/";
  std::string ids;
  while (true) {
    const size_t at = text.find(kScenes);
    if (at == std::string_view::npos) break;
    ids.append(text.substr(0, at + kScenes.size()));
    text.remove_prefix(at + kScenes.size());
    text.remove_prefix(PrefixLength(text));
  }
  return ids.append(text);
}

}  // namespace pepeseg
