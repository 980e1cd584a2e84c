#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "core/dataset/dataset_index.h"
#include "core/scene/camera.h"
#include "core/scene/lens.h"

namespace pepeseg {

// A photograph's place, as a file of poses has it.
struct PhotoPose {
  std::string name;  // below images/, or not; of a photograph that need not be there
  uint32_t camera_id = 0;
  Pose cam_from_world;
};

// What the files of poses say, whatever their format.
struct PhotoPoses {
  std::string file, camera_file;    // of poses and of lenses, for errors
  std::map<uint32_t, Lens> lenses;  // by camera id
  std::vector<PhotoPose> photos;
  std::vector<std::string> warnings;
};

// Of the format that the index says. INVALID_ARGUMENT: no poses, or as in colmap.h,
// transforms_json.h and poses_bounds.h.
absl::StatusOr<PhotoPoses> ReadPhotoPoses(const DatasetIndex& index);

// The pose of a camera with the axes x right, y down, z forward (the columns of `world_from_cam`,
// in world axes) at `center`. The matrix may have a scale, the same for all axes: it is taken out.
// INVALID_ARGUMENT says what is wrong: not finite, too far away, axes that are not at right angles
// or of one length within 1 %, a reflection.
absl::StatusOr<Pose> PoseOfAxes(const Eigen::Matrix3d& world_from_cam,
                                const Eigen::Vector3d& center);

// The camera id of the lens, which is added if it is not there yet. INVALID_ARGUMENT: see Validate.
absl::StatusOr<uint32_t> AddLens(const Lens& lens, PhotoPoses& poses);

}  // namespace pepeseg
