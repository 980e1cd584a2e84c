#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"
#include "pepeseg/v1/dataset_service.pb.h"

namespace pepeseg::client {

// The kind of a file by its name relative to the dataset's folder; none: no part of a dataset.
//   images/...                          photographs (.jpg .jpeg .png .webp .heic .heif), also in
//                                          subfolders
//   videos/..., images/...              videos (.mp4 .m4v .mov .webm .mkv .avi)
//   sparse/0/ or sparse/                COLMAP cameras, images (POSES), points3D (POINTS)
//   transforms.json, poses_bounds.npy   poses of nerfstudio or instant-ngp, or of LLFF
//   masks/STEM.json|png                 SAM masks with COCO RLE, or a label image
//   ignore_mask.png, ignore/STEM.png    pixels to leave out, of all views or of one
//   points.ply, sparse_pc.ply           points to start from in place of COLMAP's
//   gaussians.ply                       3DGS's layout: taken in place of a reconstruction
//   depth/STEM.png|npy|pfm              far is large; or what `in_depth` says: DEPTH or DISPARITY
//   disparity/STEM.png|npy|pfm          near is large
std::optional<v1::FileKind> KindOf(absl::string_view name,
                                   v1::FileKind in_depth = v1::FILE_KIND_DEPTH);

struct FolderFile {
  std::string name;  // relative, with '/'
  v1::FileKind kind = v1::FILE_KIND_UNSPECIFIED;
  std::filesystem::path path;
};

struct DatasetFolder {
  std::vector<FolderFile> files;      // by name
  std::vector<std::string> left_out;  // names of what is no part of a dataset
};

bool Has(const DatasetFolder& folder, v1::FileKind kind);

// A dataset's folder, or one video. Photographs and videos that stand in the folder itself are
// taken as images/NAME and videos/NAME where it has none below images/ and videos/. NOT_FOUND: no
// such folder. INVALID_ARGUMENT: no photographs and no video in it, said with what was looked for.
// Links to files are followed, links to folders are not.
absl::StatusOr<DatasetFolder> ReadDatasetFolder(const std::filesystem::path& folder,
                                                v1::FileKind in_depth = v1::FILE_KIND_DEPTH);

}  // namespace pepeseg::client
