#pragma once

#include <map>
#include <span>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"
#include "core/dataset/dataset_index.h"
#include "core/dataset/photo_poses.h"

namespace pepeseg {

// A photograph with its pose.
struct Match {
  std::string key;
  const DatasetFile* photo = nullptr;
  PhotoPose pose;
};

// Matches poses and photographs by name, exactly or else as PhotoNames does. Returns the matches
// sorted by name. Adds warnings to the index of photographs and poses that have no counterpart, and
// of those whose names differ. INVALID_ARGUMENT: two poses are of one photograph.
absl::StatusOr<std::vector<Match>> MatchPoses(const PhotoPoses& poses, DatasetIndex& index);

// Checks files that belong to photographs by name without suffix, such as masks. Returns
// INVALID_ARGUMENT if one could belong to two photographs whose names differ only in the suffix.
// Warns of files that belong to no view.
absl::Status CheckCompanions(const std::vector<std::string>& keys,
                             const std::map<std::string, const DatasetFile*>& companions,
                             absl::string_view what, std::vector<std::string>& warnings);

// Returns a warning such as "3 photographs have no pose and are left out: a.jpg, b.jpg, c.jpg".
std::string LeftOut(std::span<const std::string> names, absl::string_view what);

}  // namespace pepeseg
