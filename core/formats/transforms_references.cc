#include "core/formats/transforms_references.h"

#include "absl/strings/str_join.h"
#include "absl/strings/str_replace.h"
#include "absl/strings/str_split.h"
#include "core/base/status_macros.h"
#include "core/formats/file_json.h"
#include "nlohmann/json.hpp"

namespace pepeseg {
namespace {

// Returns the path in a field, or an empty string.
std::string PathIn(const nlohmann::json& object, const char* key) {
  const auto found = object.find(key);
  return found != object.end() && found->is_string()
             ? PlainPath(found->get_ref<const std::string&>())
             : std::string();
}

}  // namespace

std::string PlainPath(const std::string& path) {
  std::vector<std::string> parts =
      absl::StrSplit(absl::StrReplaceAll(path, {{"\\", "/"}}), '/', absl::SkipEmpty());
  std::erase_if(parts, [](const std::string& part) { return part == "." || part == ".."; });
  return absl::StrJoin(parts, "/");
}

absl::StatusOr<TransformsReferences> ParseTransformsReferences(absl::string_view text) {
  ASSIGN_OR_RETURN(const nlohmann::json document, ParseFileJson(text));
  if (!document.is_object()) return absl::InvalidArgumentError("not a JSON object");
  TransformsReferences references;
  references.points = PathIn(document, "ply_file_path");
  const std::string mask_of_all = PathIn(document, "mask_path");
  const auto frames = document.find("frames");
  if (frames == document.end() || !frames->is_array()) return references;
  for (const nlohmann::json& frame : *frames) {
    if (!frame.is_object()) continue;
    TransformsReferences::Frame paths = {PathIn(frame, "file_path"), PathIn(frame, "mask_path")};
    if (paths.mask.empty()) paths.mask = mask_of_all;
    if (!paths.photo.empty()) references.frames.push_back(std::move(paths));
  }
  return references;
}

}  // namespace pepeseg
