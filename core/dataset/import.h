#pragma once

#include <filesystem>
#include <span>
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
  kVideo,  // passed over by ImportCapture: its frames are photographs, see video_frames.h
};

// One file of a dataset. `name` is what its owner calls it, relative to the dataset's folder, with
// '/' ("images/0001.jpg", "sparse/0/cameras.bin", "masks/0001.json"): metadata that matches files
// to each other and is printed in errors, never opened. `path` is where its bytes are.
struct DatasetFile {
  FileKind kind = FileKind::kImage;
  std::string name;
  std::filesystem::path path;
};

// The files of a folder laid out as users bring it, sorted by name; others are left out.
//   images/...                     photographs: JPEG, PNG, WebP or HEIC, also in subfolders
//   sparse/0/ or sparse/           COLMAP cameras, images, points3D, .bin or .txt
//   transforms.json                poses of nerfstudio or instant-ngp (transforms_json.h)
//   poses_bounds.npy               poses of LLFF (poses_bounds.h)
//   masks/STEM.json|png            SAM automatic masks (COCO RLE), or a label image (0 = none)
//   ignore_mask.png, ignore/STEM.png   for all views, or for one: non-zero = leave out
//   points.ply, sparse_pc.ply      points to start from in place of COLMAP's
//   videos/...                     videos: MP4, MOV, WebM, MKV or AVI
//   gaussians.ply                  Gaussians to take in place of stage one's (gaussian_ply.h)
//   depth/STEM.png|npy|pfm         depth: far is large, 0 = unknown
//   disparity/STEM.png|npy|pfm     disparity: near is large
// `depth_folder`: what depth/ holds, where it is not what its name says.
absl::StatusOr<std::vector<DatasetFile>> ListDataset(
    const std::filesystem::path& folder, DepthPrior::Kind depth_folder = DepthPrior::Kind::kDepth);

struct ImportOptions {
  double image_scale = 1.0;  // (0, 1]: photographs and cameras are shrunk by this, area-averaged
  int held_out_every = 8;    // every n-th view by name is held out, from the first; 0: none
};
absl::Status Validate(const ImportOptions& options);

// A mask or depth map belongs to the photograph of the same name without suffix and folder:
// masks/cam0/7.json to images/cam0/7.jpg. Views are named by their photographs below images/
// ("cam0/7.jpg"), whether COLMAP's names have that folder or not.
//
// The "prepare" stage: decodes, checks and undistorts. INVALID_ARGUMENT names the file, and the
// index, the field and the limit where there is one. No allocation follows a count that a file only
// claims. Photographs that the poses do not list, and poses without a photograph, are left out with
// a warning, and so is a depth map that knows nothing; fewer than 2 usable views is an error.
// Gaussians are only seen to be one file: they are no part of the capture.
absl::StatusOr<Capture> ImportCapture(std::span<const DatasetFile> files,
                                      const ImportOptions& options);

// Adds masks and depth maps, made after the import, to the views of `capture` that they belong to,
// as ImportCapture would have: the photographs are not decoded again. Returns warnings. On an
// error, as of ImportCapture, the capture stays as it was.
absl::StatusOr<std::vector<std::string>> ImportPriors(std::span<const DatasetFile> files,
                                                      Capture& capture);

}  // namespace pepeseg
