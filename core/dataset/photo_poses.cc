#include "core/dataset/photo_poses.h"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "core/base/file_io.h"
#include "core/base/status_macros.h"
#include "core/dataset/photo_names.h"
#include "core/dataset/transforms_json.h"
#include "core/formats/colmap.h"
#include "core/formats/npy.h"

namespace pepeseg {
namespace {

constexpr int kPosesBoundsColumns = 17;
// A header, and 17 doubles for each of kMaxViews poses.
constexpr int64_t kMaxPosesBoundsBytes = (int64_t{64} << 10) + kMaxViews * kPosesBoundsColumns * 8;

using Matrix35 = Eigen::Matrix<double, 3, 5, Eigen::RowMajor>;

// Compares all numbers exactly: photographs of one camera have the same text in the file.
bool SameLens(const Lens& a, const Lens& b) {
  return a.model == b.model && a.width == b.width && a.height == b.height && a.fx == b.fx &&
         a.fy == b.fy && a.cx == b.cx && a.cy == b.cy && a.distortion == b.distortion;
}

// A COLMAP model of several.
struct ModelImages {
  const ColmapFiles* files = nullptr;
  std::vector<ColmapImage> images;
  int num_photos = 0;  // images with a photograph
};

// Reads the model with the most photographs; of equal ones the first. COLMAP writes several where
// it could not join all photographs, and their coordinates differ. Skips models that cannot be
// read; if none can be read, returns the error of the first.
absl::StatusOr<ModelImages> ReadLargestModel(const DatasetIndex& index,
                                             std::vector<std::string>& warnings) {
  const PhotoNames names(index.photos);
  ModelImages largest;
  absl::Status unreadable;
  std::vector<std::string> sizes;
  for (const ColmapFiles& files : index.colmap_models) {
    auto images = ReadColmapImages(files.images->path, files.images->name);
    if (!images.ok()) {
      unreadable.Update(images.status());
      sizes.push_back(absl::StrCat(files.images->name, " cannot be read"));
      continue;
    }
    const auto num_photos = static_cast<int>(std::ranges::count_if(
        *images, [&](const ColmapImage& image) { return !names.Find(image.name).empty(); }));
    sizes.push_back(absl::StrCat(files.images->name, " has ", num_photos));
    if (largest.files == nullptr || num_photos > largest.num_photos) {
      largest = {&files, *std::move(images), num_photos};
    }
  }
  if (largest.files == nullptr) return unreadable;
  if (sizes.size() > 1) {
    warnings.push_back(absl::StrCat(
        sizes.size(), " COLMAP models: that of ", largest.files->images->name,
        " is used, which has the most photographs (", absl::StrJoin(sizes, ", "), ")"));
  }
  return largest;
}

absl::StatusOr<PhotoPoses> ReadColmapPoses(const DatasetIndex& index) {
  PhotoPoses poses;
  ASSIGN_OR_RETURN(ModelImages model, ReadLargestModel(index, poses.warnings));
  const ColmapFiles& files = *model.files;
  ASSIGN_OR_RETURN(ColmapCameras cameras,
                   ReadColmapCameras(files.cameras->path, files.cameras->name));
  poses.file = files.images->name;
  poses.camera_file = files.cameras->name;
  poses.points = files.points;
  poses.lenses = std::move(cameras.by_id);
  poses.photos.reserve(model.images.size());
  for (ColmapImage& image : model.images) {
    poses.photos.push_back({std::move(image.name), image.camera_id, image.cam_from_world});
  }
  return poses;
}

// Returns a pinhole of that size and focal length. Sizes are stored as floats, so they are checked
// to be integers.
absl::StatusOr<Lens> PinholeOf(double height, double width, double focal) {
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
absl::Status AddPosesBoundsRow(const Matrix35& row, const std::string& photo, PhotoPoses& poses) {
  Eigen::Matrix3d world_from_cam;
  // LLFF's 3x5 matrix: three axes, the centre, and (height, width, focal length). The last two of
  // the 17 numbers are depth bounds, which are not used.
  world_from_cam << row.col(1), row.col(0), -row.col(2);
  PhotoPose pose;
  pose.name = photo;
  ASSIGN_OR_RETURN(pose.cam_from_world, PoseOfAxes(world_from_cam, row.col(3)));
  ASSIGN_OR_RETURN(const Lens lens, PinholeOf(row(0, 4), row(1, 4), row(2, 4)));
  ASSIGN_OR_RETURN(pose.camera_id, AddLens(lens, poses));
  poses.photos.push_back(std::move(pose));
  return absl::OkStatus();
}

}  // namespace

absl::StatusOr<PhotoPoses> ReadPhotoPoses(const DatasetIndex& index) {
  switch (index.pose_format) {
    case PoseFormat::kColmap:
      return ReadColmapPoses(index);
    case PoseFormat::kTransformsJson:
      return ReadTransformsJson(index);
    case PoseFormat::kPosesBounds:
      return ReadPosesBounds(index);
    case PoseFormat::kNone:
      break;
  }
  return absl::InvalidArgumentError(
      "no poses among the files: COLMAP's cameras and images (.bin or .txt, in one folder), "
      "transforms.json or poses_bounds.npy");
}

absl::StatusOr<Pose> PoseOfAxes(const Eigen::Matrix3d& world_from_cam,
                                const Eigen::Vector3d& center) {
  // Some tools write matrices with only three digits.
  constexpr double kMostError = 0.01;
  constexpr double kMostScale = 1e6;
  constexpr double kMostDistance = 1e12;
  if (!world_from_cam.allFinite() || !center.allFinite()) {
    return absl::InvalidArgumentError("the pose is not finite");
  }
  if (!(center.norm() <= kMostDistance)) {
    return absl::InvalidArgumentError(absl::StrCat("the camera is beyond ", kMostDistance));
  }
  // The Frobenius norm of a rotation is sqrt(3).
  const double scale = world_from_cam.norm() / std::sqrt(3.0);
  if (!(scale >= 1 / kMostScale && scale <= kMostScale)) {
    return absl::InvalidArgumentError(
        absl::StrCat("the axes of the camera have the length ", scale, ", 1 is usual"));
  }
  const Eigen::Matrix3d axes = world_from_cam / scale;
  // A^T A is the identity for a rotation. An error of `kMostError` in the length of an axis doubles
  // in its square.
  const Eigen::Matrix3d error = axes.transpose() * axes - Eigen::Matrix3d::Identity();
  if (error.cwiseAbs().maxCoeff() > 2 * kMostError) {
    return absl::InvalidArgumentError(
        "the axes of the camera are not at right angles and of one length within 1 %");
  }
  if (axes.determinant() < 0) {
    return absl::InvalidArgumentError("the axes of the camera are mirrored, not rotated");
  }
  // Invert: x_cam = R^T (x_world - center).
  const Eigen::Quaterniond rotation = Eigen::Quaterniond(axes).normalized().conjugate();
  return Pose{rotation, -(rotation * center)};
}

absl::StatusOr<uint32_t> AddLens(const Lens& lens, PhotoPoses& poses) {
  RETURN_IF_ERROR(Validate(lens));
  // Searches from the end: a photograph mostly shares the lens of the one before it.
  const auto same = std::find_if(poses.lenses.rbegin(), poses.lenses.rend(),
                                 [&](const auto& known) { return SameLens(known.second, lens); });
  if (same != poses.lenses.rend()) return same->first;
  // These formats have no camera ids: lenses are numbered from 0.
  const auto id = static_cast<uint32_t>(poses.lenses.size());
  poses.lenses[id] = lens;
  return id;
}

absl::StatusOr<Lens> FitLens(const Lens& lens, int width, int height, absl::string_view name) {
  if (width == lens.width && height == lens.height) return lens;
  const double expected_height = static_cast<double>(width) * lens.height / lens.width;
  const double expected_width = static_cast<double>(height) * lens.width / lens.height;
  if (std::abs(height - expected_height) > 1 && std::abs(width - expected_width) > 1) {
    return absl::InvalidArgumentError(absl::StrCat(
        name, ": ", width, "x", height, " pixels, its camera has ", lens.width, "x", lens.height));
  }
  return Resized(lens, width, height);
}

absl::StatusOr<PhotoPoses> ReadPosesBounds(const DatasetIndex& index) {
  const std::string& name = index.poses_bounds->name;
  ASSIGN_OR_RETURN(const std::string bytes,
                   ReadFile(index.poses_bounds->path, name, kMaxPosesBoundsBytes));
  ASSIGN_OR_RETURN(const NpyTable table, ParseNpyTable(name, bytes));
  if (table.num_columns != kPosesBoundsColumns) {
    return absl::InvalidArgumentError(absl::StrCat(name, ": has ", table.num_columns,
                                                   " numbers per photograph, LLFF's have ",
                                                   kPosesBoundsColumns));
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
    const absl::Status added = AddPosesBoundsRow(
        Eigen::Map<const Matrix35>(table.values.data() + row * kPosesBoundsColumns), key, poses);
    if (!added.ok()) {
      return absl::InvalidArgumentError(
          absl::StrCat(name, ": row ", row, " (", key, "): ", added.message()));
    }
    ++row;
  }
  return poses;
}

}  // namespace pepeseg
