#include "server/store/scene_key.h"

#include <algorithm>

#include "absl/strings/ascii.h"

namespace pepeseg {
namespace {

constexpr size_t kMaxIdBytes = 63;
// No id contains it (IsResourceId), so a key is never taken for an id.
constexpr char kEndOfNumber = '@';

// Returns the length of "NUMBER@" at the start of `text`, or 0 if there is none.
size_t PrefixLength(std::string_view text) {
  const auto end = std::find_if_not(text.begin(), text.end(), absl::ascii_isdigit);
  if (end == text.begin() || end == text.end() || *end != kEndOfNumber) return 0;
  return static_cast<size_t>(end - text.begin()) + 1;
}

}  // namespace

bool IsRfc1034Label(std::string_view id) {
  if (id.empty() || id.size() > kMaxIdBytes || !absl::ascii_islower(id.front()) ||
      id.back() == '-') {
    return false;
  }
  return std::all_of(id.begin(), id.end(), [](unsigned char c) {
    return absl::ascii_islower(c) || absl::ascii_isdigit(c) || c == '-';
  });
}

bool IsResourceId(std::string_view id) {
  if (id.empty() || id.size() > kMaxIdBytes || !absl::ascii_isalnum(id.front())) return false;
  return std::all_of(id.begin(), id.end(), [](unsigned char c) {
    return absl::ascii_isalnum(c) || c == '_' || c == '.' || c == '-';
  });
}

std::string MakeSceneKey(int64_t number, std::string_view id) {
  return std::to_string(number) + kEndOfNumber + std::string(id);
}

bool IsSceneKey(std::string_view text) { return IsResourceId(text.substr(PrefixLength(text))); }

std::string SceneIdOf(std::string_view key) { return std::string(key.substr(PrefixLength(key))); }

// The numbers of scenes begin at 1.
std::string NoSceneKey(std::string_view id) { return MakeSceneKey(0, id); }

std::string WithSceneIds(std::string_view text) {
  constexpr std::string_view kScenes = "scenes/";
  std::string ids;
  while (true) {
    const size_t at = text.find(kScenes);
    if (at == std::string_view::npos) break;
    ids.append(text.substr(0, at + kScenes.size()));
    text.remove_prefix(at + kScenes.size());
    // PrefixLength is 0 for an id, which stays.
    text.remove_prefix(PrefixLength(text));
  }
  return ids.append(text);
}

}  // namespace pepeseg
