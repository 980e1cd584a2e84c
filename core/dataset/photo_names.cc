#include "core/dataset/photo_names.h"

#include <utf8proc.h>

#include <cstdlib>

#include "absl/strings/ascii.h"
#include "absl/strings/str_replace.h"
#include "core/base/file_name.h"

namespace pepeseg {
namespace {

// Adds an entry; a second one with the same key leaves the key ambiguous.
void AddUnique(const std::string& key, const std::string& name,
               std::map<std::string, std::string>& names) {
  const auto [entry, added] = names.try_emplace(key, name);
  if (!added) entry->second.clear();
}

std::string ValueOf(const std::map<std::string, std::string>& names, const std::string& key) {
  const auto found = names.find(key);
  return found == names.end() ? "" : found->second;
}

}  // namespace

std::string FoldName(absl::string_view name) {
  utf8proc_uint8_t* folded = nullptr;
  const auto options =
      static_cast<utf8proc_option_t>(UTF8PROC_STABLE | UTF8PROC_COMPOSE | UTF8PROC_CASEFOLD);
  const utf8proc_ssize_t size =
      utf8proc_map(reinterpret_cast<const utf8proc_uint8_t*>(name.data()),
                   static_cast<utf8proc_ssize_t>(name.size()), &folded, options);
  if (size < 0) return absl::AsciiStrToLower(name);
  std::string result(reinterpret_cast<const char*>(folded), static_cast<size_t>(size));
  std::free(folded);  // utf8proc_map has allocated it
  return result;
}

PhotoNames::PhotoNames(const std::map<std::string, const DatasetFile*>& photos) : photos_(photos) {
  for (const auto& [name, photo] : photos) {
    const std::string folded = FoldName(name);
    AddUnique(folded, name, by_name_);
    AddUnique(std::string(WithoutSuffix(folded)), name, by_stem_);
  }
}

std::string PhotoNames::Find(const std::string& path) const {
  // Names of files have no backslashes; programs on Windows write them between folders.
  return FindBelowFolders(absl::StrReplaceAll(path, {{"\\", "/"}}), std::string(),
                          [this](const std::string& name) { return FindWhole(name); });
}

// The name as it is first, then with other letters, then without suffix: frames often lack ".png",
// or name another format.
std::string PhotoNames::FindWhole(const std::string& name) const {
  if (photos_.contains(name)) return name;
  const std::string folded = FoldName(name);
  for (const auto& [names, key] : {std::pair(&by_name_, folded), std::pair(&by_stem_, folded),
                                   std::pair(&by_stem_, std::string(WithoutSuffix(folded)))}) {
    if (std::string found = ValueOf(*names, key); !found.empty()) return found;
  }
  return "";
}

}  // namespace pepeseg
