#pragma once

#include <cstdint>
#include <map>
#include <span>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"
#include "core/dataset/dataset_files.h"

namespace pepeseg {

// Format of the files that poses come from. If there are several, the first in this order is used.
enum class PoseFormat { kNone, kColmap, kTransformsJson, kPosesBounds };

// The files of one COLMAP model, which are in one folder.
struct ColmapFiles {
  const DatasetFile* cameras = nullptr;
  const DatasetFile* images = nullptr;
  const DatasetFile* points = nullptr;  // may be null
};

// The files of a dataset, by the photograph or purpose that they belong to. Points into the span
// that it was made from, which must outlive it.
struct DatasetIndex {
  // Photographs by their name below images/: "cam0/0001.jpg" (see PhotoKey).
  std::map<std::string, const DatasetFile*> photos;
  // Files by the name of their photograph without suffix: "cam0/0001".
  std::map<std::string, const DatasetFile*> masks;
  // Binary PNGs of a photograph, one a mask, by name: those in masks/STEM/.
  std::map<std::string, std::vector<const DatasetFile*>> mask_folders;
  std::map<std::string, const DatasetFile*> ignore;
  // Masks of transforms.json (mask_path), in which 0 is what is ignored. They are never segments.
  std::map<std::string, const DatasetFile*> keep;
  std::map<std::string, const DatasetFile*> depth;  // depth or disparity
  const DatasetFile* ignore_all = nullptr;
  std::vector<ColmapFiles> colmap_models;     // by their folders' names
  const DatasetFile* transforms = nullptr;    // nerfstudio or instant-ngp
  const DatasetFile* poses_bounds = nullptr;  // LLFF
  PoseFormat pose_format = PoseFormat::kNone;
  std::vector<const DatasetFile*> point_clouds;  // PLY
  const DatasetFile* ply_points = nullptr;       // the one of them that is used
  const DatasetFile* gaussians = nullptr;
  std::vector<std::string> warnings;
};

// Indexes the files of a dataset. Reads transforms.json, which says what some of them are.
// INVALID_ARGUMENT: ValidateName refuses a name, two files have the same purpose, or there is no
// photograph.
absl::StatusOr<DatasetIndex> IndexDataset(std::span<const DatasetFile> files);

// Indexes masks and depth maps of these photographs, which are not among the files. `photographs`:
// names as PhotoKey returns them. INVALID_ARGUMENT: ValidateName refuses a name, or two files have
// the same purpose.
absl::StatusOr<DatasetIndex> IndexPriors(std::span<const DatasetFile> files,
                                         std::span<const std::string> photographs);

}  // namespace pepeseg
