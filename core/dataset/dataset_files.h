#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "core/scene/capture.h"

namespace pepeseg {

enum class FileKind {
  kImage,
  kPoses,
  kMask,
  kIgnoreMask,
  kDepth,
  kDisparity,
  kPoints,
  kGaussians,
  kVideo,  // ignored by ImportCapture; its frames become photographs first, see video_frames.h
};

// One file of a dataset.
struct DatasetFile {
  FileKind kind = FileKind::kImage;
  // The owner's name, relative to the dataset's folder, with '/' ("images/0001.jpg",
  // "sparse/0/cameras.bin", "masks/0001.json"). It matches files to each other and is printed in
  // errors; it is never opened as a path.
  std::string name;
  std::filesystem::path path;  // where the bytes are
};

// Lists the files of a folder that has the layout below, sorted by name. Ignores other files.
//   images/...                     photographs: JPEG, PNG, WebP or HEIC, also in subfolders
//   sparse/N/ or sparse/           COLMAP cameras, images, points3D, .bin or .txt
//   transforms.json                poses of nerfstudio or instant-ngp (transforms_json.h)
//   poses_bounds.npy               poses of LLFF (photo_poses.h)
//   masks/STEM.json|png|npy        SAM automatic masks (COCO RLE), a label image (0 = none), or an
//                                  array [masks, height, width]
//   masks/STEM/NAME.png            binary masks, one a file
//   ignore_mask.png, ignore/STEM.png   for all views, or for one: non-zero pixels are ignored
//   points.ply, sparse_pc.ply      initial points, in place of COLMAP's
//   videos/...                     videos: MP4, MOV, WebM, MKV or AVI
//   gaussians.ply                  Gaussians, in place of stage one's result (gaussian_ply.h)
//   depth/STEM.png|npy|pfm         depth: grows away from the camera, 0 = unknown
//   disparity/STEM.png|npy|pfm     disparity: grows towards the camera
// `depth_folder` overrides what the files in depth/ hold. NOT_FOUND: there is no such folder.
// INVALID_ARGUMENT: it has neither photographs nor videos. INTERNAL: it cannot be listed.
absl::StatusOr<std::vector<DatasetFile>> ListDataset(
    const std::filesystem::path& folder, DepthPrior::Kind depth_folder = DepthPrior::Kind::kDepth);

}  // namespace pepeseg
