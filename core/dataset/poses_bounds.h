#pragma once

#include "absl/status/statusor.h"
#include "core/dataset/dataset_index.h"
#include "core/dataset/photo_poses.h"

namespace pepeseg {

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
