#include <algorithm>
#include <initializer_list>

#include "absl/strings/ascii.h"
#include "core/base/file_name.h"
#include "core/dataset/dataset_files.h"

namespace pepeseg {
namespace {

bool IsOneOf(absl::string_view text, std::initializer_list<absl::string_view> list) {
  return std::find(list.begin(), list.end(), text) != list.end();
}

// Returns the name by which the photograph and the video of a Live Photo are one.
std::string PictureStem(absl::string_view name) {
  const absl::string_view below = WithoutFolder(WithoutFolder(name, "images"), "videos");
  return absl::AsciiStrToLower(WithoutSuffix(below));
}

}  // namespace

std::set<std::string> ExtraFiles(std::span<const std::string> names) {
  std::set<std::string> extra, photographs;
  for (const std::string& name : names) {
    if (IsSystemFile(name)) {
      extra.insert(name);
    } else if (IsOneOf(Suffix(name), {".jpg", ".jpeg", ".heic", ".heif", ".png", ".webp"}) &&
               !IsOneOf(name.substr(0, name.find('/')),
                        {"masks", "ignore", "depth", "disparity"})) {
      photographs.insert(PictureStem(name));
    }
  }
  for (const std::string& name : names) {
    if (!IsOneOf(Suffix(name), {".mov", ".mp4"})) continue;
    if (photographs.contains(PictureStem(name))) extra.insert(name);
  }
  return extra;
}

}  // namespace pepeseg
