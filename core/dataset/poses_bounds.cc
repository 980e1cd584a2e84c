#include "core/dataset/poses_bounds.h"

#include <cmath>

#include "absl/strings/str_cat.h"
#include "core/base/file_bytes.h"
#include "core/base/status_macros.h"
#include "core/formats/colmap.h"
#include "core/formats/npy.h"

namespace pepeseg {
namespace {

constexpr int kNumColumns = 17;
// A header, and 17 doubles for each of kMaxViews poses.
constexpr int64_t kMaxFileBytes = (int64_t{64} << 10) + kMaxViews * kNumColumns * 8;

using Matrix35 = Eigen::Matrix<double, 3, 5, Eigen::RowMajor>;

// Returns a pinhole of that size and focal length. Sizes are stored as floats, so they are checked
// to be integers.
absl::StatusOr<Lens> LensOf(double height, double width, double focal) {
  for (const double size : {height, width}) {
    if (!(size >= 1 && size <= 1e6) || size != std::floor(size)) {
      return absl::InvalidArgumentError(
          absl::StrCat("height ", height, " and width ", width, " are not a size in whole pixels"));
    }
  }
  Lens lens;
  lens.width = static_cast<int>(width);
  lens.height = static_cast<int>(height);
  lens.fx = lens.fy = focal;
  lens.cx = width / 2;
  lens.cy = height / 2;
  return lens;
}

// Adds the pose and the lens of one photograph. LLFF's axes (down, right, backwards) become (right,
// down, forward).
absl::Status AddRow(const Matrix35& row, const std::string& photo, PhotoPoses& poses) {
  Eigen::Matrix3d world_from_cam;
  // LLFF's 3x5 matrix: three axes, the centre, and (height, width, focal length). The last two of
  // the 17 numbers are depth bounds, which are not used.
  world_from_cam << row.col(1), row.col(0), -row.col(2);
  PhotoPose pose;
  pose.name = photo;
  ASSIGN_OR_RETURN(pose.cam_from_world, PoseOfAxes(world_from_cam, row.col(3)));
  ASSIGN_OR_RETURN(const Lens lens, LensOf(row(0, 4), row(1, 4), row(2, 4)));
  ASSIGN_OR_RETURN(pose.camera_id, AddLens(lens, poses));
  poses.photos.push_back(std::move(pose));
  return absl::OkStatus();
}

}  // namespace

absl::StatusOr<PhotoPoses> ReadPosesBounds(const DatasetIndex& index) {
  const std::string& name = index.poses_bounds->name;
  ASSIGN_OR_RETURN(const std::string bytes,
                   ReadFile(index.poses_bounds->path, name, kMaxFileBytes));
  ASSIGN_OR_RETURN(const NpyTable table, ParseNpyTable(name, bytes));
  if (table.num_columns != kNumColumns) {
    return absl::InvalidArgumentError(absl::StrCat(
        name, ": has ", table.num_columns, " numbers a photograph, LLFF's have ", kNumColumns));
  }
  // The file has no names, so its poses can only be matched by their order.
  if (static_cast<size_t>(table.num_rows) != index.photos.size()) {
    return absl::InvalidArgumentError(
        absl::StrCat(name, ": has ", table.num_rows, " poses for ", index.photos.size(),
                     " photographs: it has one for each, in the order of their names. Bring the "
                     "photographs that "
                     "it was made from, no more and no fewer"));
  }
  PhotoPoses poses;
  poses.file = poses.camera_file = name;
  poses.photos.reserve(index.photos.size());
  size_t row = 0;
  for (const auto& [key, photo] : index.photos) {
    const absl::Status added =
        AddRow(Eigen::Map<const Matrix35>(table.values.data() + row * kNumColumns), key, poses);
    if (!added.ok()) {
      return absl::InvalidArgumentError(
          absl::StrCat(name, ": row ", row, " (", key, "): ", added.message()));
    }
    ++row;
  }
  return poses;
}

}  // namespace pepeseg
