#pragma once

#include <map>
#include <span>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"
#include "core/dataset/import.h"

namespace pepeseg {

// Where poses come from, in the order in which they are taken where there are several.
enum class PoseFormat { kNone, kColmap, kTransformsJson, kPosesBounds };

// The files of a dataset by what they belong to. Borrows the files.
struct DatasetIndex {
  // By name below images/: "cam0/0001.jpg". As COLMAP's names, which may have "images/" or not.
  std::map<std::string, const DatasetFile*> photos;
  // By photograph without suffix: "cam0/0001".
  std::map<std::string, const DatasetFile*> masks;
  std::map<std::string, const DatasetFile*> ignore;
  std::map<std::string, const DatasetFile*> depth;  // of either kind
  const DatasetFile* ignore_all = nullptr;
  // One COLMAP model; points may be missing. Cameras and images are both there, or neither.
  const DatasetFile* cameras = nullptr;
  const DatasetFile* images = nullptr;
  const DatasetFile* colmap_points = nullptr;
  const DatasetFile* transforms = nullptr;    // of nerfstudio or instant-ngp
  const DatasetFile* poses_bounds = nullptr;  // of LLFF
  PoseFormat pose_format = PoseFormat::kNone;
  const DatasetFile* ply_points = nullptr;
  const DatasetFile* gaussians = nullptr;
  std::vector<std::string> warnings;
};

// INVALID_ARGUMENT: a name that ValidateName refuses; two files for one thing; no photograph.
absl::StatusOr<DatasetIndex> IndexDataset(std::span<const DatasetFile> files);

// Indexes masks and depth maps without the photographs that they belong to. INVALID_ARGUMENT: as
// for IndexDataset.
absl::StatusOr<DatasetIndex> IndexPriors(std::span<const DatasetFile> files);

// A photograph's name as the index and the views have it.
std::string PhotoKey(absl::string_view name);

}  // namespace pepeseg
