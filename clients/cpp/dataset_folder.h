#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"
#include "pepeseg/v1/dataset_service.pb.h"

namespace pepeseg::client {

// Returns the kind of a file by its name relative to the folder of the dataset, with '/'; nothing
// if the file is not part of a dataset.
//   images/...                          photographs (.jpg .jpeg .png .webp .heic .heif), also in
//                                       subfolders
//   videos/..., images/...              videos (.mp4 .m4v .mov .webm .mkv .avi)
//   sparse/0/ or sparse/                COLMAP cameras, images (POSES), points3D (POINTS)
//   transforms.json, poses_bounds.npy   poses of nerfstudio or instant-ngp, and of LLFF
//   masks/STEM.json|png|npy             masks: SAM's JSON with COCO RLE, a label image, or an array
//                                       [masks, height, width]
//   masks/STEM/NAME.png                 binary masks, one a file
//   ignore_mask.png, ignore/STEM.png    pixels to leave out of all views, or of one
//   points.ply, sparse_pc.ply           points to start from, used instead of COLMAP's
//   gaussians.ply                       Gaussians in 3DGS's layout, used instead of stage one
//   depth/STEM.png|npy|pfm              depth maps, of kind `in_depth`: DEPTH (far is large) or
//                                       DISPARITY (near is large)
//   disparity/STEM.png|npy|pfm          depth maps, of kind DISPARITY
std::optional<v1::FileKind> KindOf(absl::string_view name,
                                   v1::FileKind in_depth = v1::FILE_KIND_DEPTH);

struct FolderFile {
  std::string name;  // relative to the dataset, with '/'
  v1::FileKind kind = v1::FILE_KIND_UNSPECIFIED;
  std::filesystem::path path;  // of the local file
};

struct DatasetFolder {
  std::vector<FolderFile> files;      // sorted by name
  std::vector<std::string> left_out;  // sorted names of files that are not part of a dataset
};

// Returns true if the folder has a file of this kind.
bool Has(const DatasetFolder& folder, v1::FileKind kind);

// Lists the files of a dataset's folder, or takes one video for a dataset. If the folder has
// neither photographs below images/ nor videos below videos/ or images/, those in the folder itself
// are taken as images/NAME and videos/NAME. Links to files are followed, links to folders are not.
// NOT_FOUND: no such folder. INVALID_ARGUMENT: it has no photographs and no videos.
absl::StatusOr<DatasetFolder> ReadDatasetFolder(const std::filesystem::path& folder,
                                                v1::FileKind in_depth = v1::FILE_KIND_DEPTH);

}  // namespace pepeseg::client
