#pragma once

#include "absl/status/statusor.h"
#include "core/dataset/dataset_index.h"
#include "core/dataset/photo_poses.h"

namespace pepeseg {

// LLFF's poses_bounds.npy: [num_photographs, 17] floats, a row for each photograph in the order of
// their names: a 3x5 matrix by rows, whose first three columns are the camera's axes in the world
// (down, right, backwards: of LLFF's code), the fourth its place and the last the photographs'
// height, width and focal length in pixels; then the nearest and farthest depth, which are not
// used. A pinhole with its principal point in the middle. INVALID_ARGUMENT names the file and the
// row: another shape, a number of rows that is not that of the photographs, a number that is not
// finite, a pose that PoseOfAxes refuses, a size or focal length that is none.
absl::StatusOr<PhotoPoses> ReadPosesBounds(const DatasetIndex& index);

}  // namespace pepeseg
