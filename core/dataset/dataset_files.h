#pragma once

#include <cstdint>
#include <filesystem>
#include <set>
#include <span>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"
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

// Returns those of a dataset's file names that are not the owner's work and are left out:
//   - files that systems and devices add to folders, see IsSystemFile;
//   - the video of a Live Photo, IMG_1.MOV next to IMG_1.HEIC: it lasts three seconds and shows the
//     same as the photograph. Both may be below images/ or videos/.
// `names` are relative, with '/'. Clients leave out the same files, but not all clients are ours.
std::set<std::string> ExtraFiles(std::span<const std::string> names);

// Returns the number of files of the kind kMask that may hold segments: transforms.json, if there
// is one and it can be read, names the others by mask_path, and they say what to ignore. Of other
// files than transforms.json only kind and name count.
int64_t CountSegmentMasks(std::span<const DatasetFile> files);

// Returns the name of a photograph in the index and in views: without a leading "images/", which
// COLMAP's names may or may not have.
std::string PhotoKey(absl::string_view name);

// Returns true if a photograph of this key is named as a frame of the video: "walk_000123.jpg" is
// one of "videos/walk.mp4".
bool IsFrameOf(absl::string_view video, absl::string_view photograph);

// Lists the first names: "a.jpg, b.jpg, ...".
std::string FirstNames(std::span<const std::string> names);

// Facts from the header of a file.
struct FileFacts {
  int width = 0, height = 0;  // of a photograph as it is stored, pixels
  int64_t num_points = 0;     // points or Gaussians; estimated for COLMAP's text format
};

// Returns true if ReadFileFacts reads files of this kind and name: photographs, points (PLY files
// and COLMAP's points3D) and Gaussians.
bool HasFacts(FileKind kind, absl::string_view name);

// Reads the header of such a file. Reads at most 1 MiB of it and decodes nothing. INVALID_ARGUMENT,
// naming the file: its header is refused. INTERNAL or NOT_FOUND: it cannot be read.
absl::StatusOr<FileFacts> ReadFileFacts(const DatasetFile& file);

}  // namespace pepeseg
