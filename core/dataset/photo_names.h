#pragma once

#include <map>
#include <string>

#include "absl/strings/string_view.h"
#include "core/dataset/dataset_files.h"

namespace pepeseg {

// Returns the name without the differences that people do not see: letters in lower case, and
// Unicode in its composed form (macOS decomposes "é", other systems do not). Bytes that are not
// UTF-8 stay as they are.
std::string FoldName(absl::string_view name);

// Calls find(name) with `path`, then with its leading folders dropped one by one, until it returns
// something that is not `nothing`. Returns that, or `nothing`.
template <class Found, class Find>
Found FindBelowFolders(const std::string& path, Found nothing, const Find& find) {
  for (size_t start = 0; start != std::string::npos;) {
    if (Found found = find(path.substr(start)); found != nothing) return found;
    const size_t slash = path.find('/', start);
    start = slash == std::string::npos ? slash : slash + 1;
  }
  return nothing;
}

// Finds photographs by the names that other files give them.
class PhotoNames {
 public:
  // photos: by the name below images/, see DatasetIndex. Must outlive it.
  explicit PhotoNames(const std::map<std::string, const DatasetFile*>& photos);

  // Returns the photograph's name, or an empty string. `path` may have more folders in front of it,
  // another suffix or none, '\\' for '/', and may differ as FoldName says: "../data/cam0/7" finds
  // "cam0/7.JPG".
  // A name that would fit two photographs finds neither.
  std::string Find(const std::string& path) const;
  // The same, but with no folder in front.
  std::string FindWhole(const std::string& name) const;

 private:
  const std::map<std::string, const DatasetFile*>& photos_;
  // Names of photographs by their folded name, and by that without suffix; empty: ambiguous.
  std::map<std::string, std::string> by_name_, by_stem_;
};

}  // namespace pepeseg
