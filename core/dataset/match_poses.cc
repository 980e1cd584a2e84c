#include "core/dataset/match_poses.h"

#include <algorithm>
#include <set>
#include <utility>

#include "absl/strings/ascii.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "core/base/file_name.h"
#include "core/dataset/photo_names.h"

namespace pepeseg {
namespace {

// Returns the photograph's name for each pose, or an empty string if it has none. Exact names take
// precedence over those that PhotoNames finds.
std::vector<std::string> PhotosOf(const PhotoPoses& poses, const DatasetIndex& index) {
  const PhotoNames names(index.photos);
  std::vector<std::string> keys;
  std::set<std::string> exact;
  for (const PhotoPose& pose : poses.photos) {
    std::string key = PhotoKey(pose.name);
    if (!index.photos.contains(key)) key.clear();
    if (!key.empty()) exact.insert(key);
    keys.push_back(std::move(key));
  }
  for (size_t i = 0; i < keys.size(); ++i) {
    if (!keys[i].empty()) continue;
    // A photograph that a pose names exactly belongs to that pose.
    std::string key = names.Find(PhotoKey(poses.photos[i].name));
    if (!exact.contains(key)) keys[i] = std::move(key);
  }
  return keys;
}

}  // namespace

absl::StatusOr<std::vector<Match>> MatchPoses(const PhotoPoses& poses, DatasetIndex& index) {
  const std::vector<std::string> keys = PhotosOf(poses, index);
  std::vector<Match> matches;
  std::vector<std::string> without_photo, renamed;
  std::set<std::string> posed;
  for (size_t i = 0; i < keys.size(); ++i) {
    const PhotoPose& pose = poses.photos[i];
    const std::string key = keys[i].empty() ? PhotoKey(pose.name) : keys[i];
    if (!posed.insert(key).second) {
      return absl::InvalidArgumentError(
          absl::StrCat(poses.file, ": two poses for the photograph ", key));
    }
    if (keys[i].empty()) {
      without_photo.push_back(pose.name);
      continue;
    }
    const std::string named = PhotoKey(pose.name);
    if (key != named) {
      const bool looks_alike = FoldName(key) == FoldName(named) &&
                               absl::AsciiStrToLower(key) != absl::AsciiStrToLower(named);
      renamed.push_back(
          absl::StrCat(pose.name, " is ", key, looks_alike ? " in another form of Unicode" : ""));
    }
    matches.push_back({key, index.photos.at(key), pose});
  }
  std::vector<std::string> without_pose;
  for (const auto& [key, photo] : index.photos) {
    if (!posed.contains(key)) without_pose.push_back(photo->name);
  }
  if (!renamed.empty()) {
    index.warnings.push_back(
        absl::StrCat(renamed.size(), " poses in ", poses.file,
                     " name their photographs differently: ", FirstNames(renamed)));
  }
  if (!without_pose.empty()) {
    index.warnings.push_back(LeftOut(without_pose, "photographs have no pose"));
  }
  if (!without_photo.empty()) {
    index.warnings.push_back(LeftOut(without_photo, "poses have no photograph"));
  }
  std::sort(matches.begin(), matches.end(),
            [](const Match& a, const Match& b) { return a.key < b.key; });
  return matches;
}

absl::Status CheckCompanions(const std::vector<std::string>& keys,
                             const std::map<std::string, const DatasetFile*>& companions,
                             absl::string_view what, std::vector<std::string>& warnings) {
  std::map<std::string, std::string> by_stem;
  for (const std::string& key : keys) {
    const std::string stem(WithoutSuffix(key));
    // Two photographs with one stem are valid as long as no companion could belong to both.
    const auto [other, added] = by_stem.try_emplace(stem, key);
    const auto companion = companions.find(stem);
    if (added || companion == companions.end()) continue;
    return absl::InvalidArgumentError(
        absl::StrCat(companion->second->name, " could belong to ", other->second, " and to ", key));
  }
  std::vector<std::string> lonely;
  for (const auto& [stem, file] : companions) {
    if (!by_stem.contains(stem)) lonely.push_back(file->name);
  }
  if (!lonely.empty()) {
    warnings.push_back(LeftOut(lonely, absl::StrCat(what, " belong to no view")));
  }
  return absl::OkStatus();
}

std::string LeftOut(std::span<const std::string> names, absl::string_view what) {
  return absl::StrCat(names.size(), " ", what, " and are left out: ", FirstNames(names));
}

}  // namespace pepeseg
