#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"
#include "core/dataset/dataset_index.h"
#include "core/scene/camera.h"
#include "core/scene/lens.h"

namespace pepeseg {

// The pose of a photograph, as a file of poses has it.
struct PhotoPose {
  std::string name;  // with or without "images/"; the photograph may be missing
  uint32_t camera_id = 0;
  Pose cam_from_world;
};

// The content of the files of poses, whatever their format.
struct PhotoPoses {
  std::string file, camera_file;    // names of the files with poses and lenses, for errors
  std::map<uint32_t, Lens> lenses;  // by camera id
  std::vector<PhotoPose> photos;
  const DatasetFile* points = nullptr;  // those of the COLMAP model; null: none
  std::vector<std::string> warnings;
};

// Reads the poses in the format that the index has chosen. Of several COLMAP models the one with
// the most photographs of the index is read, and a warning names all. INVALID_ARGUMENT: there are
// none, or as for colmap.h, transforms_json.h and ReadPosesBounds.
absl::StatusOr<PhotoPoses> ReadPhotoPoses(const DatasetIndex& index);

// Returns the pose of a camera at `center` whose axes x right, y down, z forward are the columns of
// `world_from_cam`, in world coordinates. A scale that all axes share is removed. INVALID_ARGUMENT:
// a number is not finite, the camera is further than 1e12 from zero, the axes are not at right
// angles or not of one length within 1 %, or the matrix is a reflection.
absl::StatusOr<Pose> PoseOfAxes(const Eigen::Matrix3d& world_from_cam,
                                const Eigen::Vector3d& center);

// Returns the camera id of the lens in `poses`, and adds the lens if it is new. INVALID_ARGUMENT:
// Validate refuses the lens.
absl::StatusOr<uint32_t> AddLens(const Lens& lens, PhotoPoses& poses);

// Returns the lens scaled to a photograph of width x height pixels, which `name` names: datasets
// are often shrunk after their poses were found. INVALID_ARGUMENT: the shapes differ by more than a
// pixel.
absl::StatusOr<Lens> FitLens(const Lens& lens, int width, int height, absl::string_view name);

// Reads LLFF's poses_bounds.npy: an array of floats [num_photographs, 17] with one pose for each
// photograph, in the order of their names. The first 15 numbers of a pose are a 3x5 matrix in
// row-major order: columns 0 to 2 are the camera's axes in the world (down, right, backwards),
// column 3 is its centre, and column 4 is height, width and focal length of the photograph in
// pixels. The last two numbers, the nearest and farthest depth, are not used. The lens is a pinhole
// with its principal point in the middle.
//
// INVALID_ARGUMENT, naming the file and the pose: the array has another shape or not one pose for
// each photograph, PoseOfAxes refuses a pose, or a size or focal length is invalid.
absl::StatusOr<PhotoPoses> ReadPosesBounds(const DatasetIndex& index);

}  // namespace pepeseg
