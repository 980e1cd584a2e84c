#pragma once

#include "absl/status/statusor.h"
#include "core/dataset/dataset_index.h"
#include "core/dataset/photo_poses.h"

namespace pepeseg {

// transforms.json of instant-ngp and nerfstudio:
//   fl_x, fl_y, cx, cy, w, h   pixels, for all frames or in a frame, which goes before; without
//                              fl_x: camera_angle_x, the width's field of view in radians; without
//                              cx, cy: the middle; without w, h: the size of the photograph
//   camera_model               OPENCV, OPENCV_FISHEYE, PINHOLE, SIMPLE_PINHOLE, RADIAL or
//                              SIMPLE_RADIAL; or is_fisheye. Without: OPENCV
//   k1 k2 k3 k4 p1 p2          OpenCV's coefficients: k1 k2 p1 p2 k3 of a lens, k1 to k4 of a
//   fisheye frames[].file_path         the photograph: with suffix or without, below any folder
//   frames[].transform_matrix  camera to world by rows, 4x4 or 3x4; OpenGL's camera axes: x right,
//                              y up, z backwards
// A photograph belongs to a frame when its whole name below images/, with suffix or without, ends
// the frame's path: "cam0/7.jpg" is "./images/cam0/7" and "../data/cam0/7.png", and not "7.jpg".
// The world is that of the file: applied_transform, by which nerfstudio turned it, is not undone.
//
// INVALID_ARGUMENT names the file and the frame: no JSON, a field of another type, a number that is
// not finite, a matrix that is no pose (PoseOfAxes), a camera model or coefficient that is not
// among these, no focal length, over kMaxViews frames. Frames without a photograph are no error.
absl::StatusOr<PhotoPoses> ReadTransformsJson(const DatasetIndex& index);

}  // namespace pepeseg
