#pragma once

#include <cstdint>

#include "absl/status/statusor.h"
#include "core/dataset/dataset_index.h"
#include "core/dataset/photo_poses.h"

namespace pepeseg {

inline constexpr int64_t kMaxTransformsBytes = int64_t{64} << 20;

// Reads the poses of transforms.json, the format of instant-ngp and nerfstudio. Its fields:
//   fl_x, fl_y, cx, cy, w, h   pixels. Without fl_x: camera_angle_x, the horizontal field of view,
//                              radians. Without cx, cy: the middle. Without w, h: the size of the
//                              photograph
//   camera_model               OPENCV, OPENCV_FISHEYE, PINHOLE, SIMPLE_PINHOLE, RADIAL or
//                              SIMPLE_RADIAL; or is_fisheye. Without both: OPENCV
//   k1 k2 k3 k4 p1 p2          OpenCV's coefficients: k1 k2 p1 p2 k3, or k1 to k4 of a fisheye
//   frames[].file_path         the photograph, with or without suffix, below any folder
//   frames[].transform_matrix  camera to world, row-major 4x4 or 3x4, with OpenGL's camera axes: x
//                              right, y up, z backwards
// The fields of the lens may be in the document, for all frames, or in a frame, where they take
// precedence. A photograph belongs to a frame if the frame's path ends with the photograph's whole
// name below images/, with or without suffix: "cam0/7.jpg" belongs to "./images/cam0/7" and
// "../data/cam0/7.png", but not to "7.jpg". The world is that of the file: applied_transform, by
// which nerfstudio has rotated it, is not undone.
//
// INVALID_ARGUMENT, naming the file and the frame: the text is not JSON, a field has another type,
// a number is not finite, PoseOfAxes refuses a matrix, the camera model or a coefficient is not one
// of the above, there is no focal length, or there are more than kMaxViews frames. A frame without
// a photograph is not an error.
absl::StatusOr<PhotoPoses> ReadTransformsJson(const DatasetIndex& index);

}  // namespace pepeseg
