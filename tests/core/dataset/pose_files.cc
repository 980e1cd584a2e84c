#include "tests/core/dataset/pose_files.h"

#include <filesystem>
#include <span>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"
#include "tests/testing/float_files.h"

namespace pepeseg::testing {
namespace {

std::string MatrixText(const FrameRecord& frame) {
  const Pose world_from_cam = frame.cam_from_world.Inverse();
  Eigen::Matrix4d matrix = Eigen::Matrix4d::Identity();
  matrix.topLeftCorner<3, 3>() = frame.scale * world_from_cam.rotation.toRotationMatrix() *
                                 Eigen::Vector3d(1, -1, -1).asDiagonal();
  matrix.topRightCorner<3, 1>() = world_from_cam.translation;
  std::vector<std::string> rows;
  rows.reserve(4);
  for (int row = 0; row < 4; ++row) {
    rows.push_back(absl::StrFormat("[%.17g, %.17g, %.17g, %.17g]", matrix(row, 0), matrix(row, 1),
                                   matrix(row, 2), matrix(row, 3)));
  }
  return absl::StrCat("[", absl::StrJoin(rows, ", "), "]");
}

}  // namespace

std::string TransformsJson(const std::string& fields, const std::vector<FrameRecord>& frames) {
  std::vector<std::string> texts;
  texts.reserve(frames.size());
  for (const FrameRecord& frame : frames) {
    texts.push_back(absl::StrCat("{\"file_path\": \"", frame.file_path, "\"", frame.more_fields,
                                 ", \"transform_matrix\": ", MatrixText(frame), "}"));
  }
  return absl::StrCat("{", fields, ", \"frames\": [", absl::StrJoin(texts, ",\n"), "]}");
}

std::vector<double> PosesBoundsRows(const std::vector<Pose>& poses) {
  std::vector<double> rows;
  for (const Pose& pose : poses) {
    const Pose world_from_cam = pose.Inverse();
    const Eigen::Matrix3d axes = world_from_cam.rotation.toRotationMatrix();
    Eigen::Matrix<double, 3, 5> matrix;
    matrix << axes.col(1), axes.col(0), -axes.col(2), world_from_cam.translation,
        Eigen::Vector3d(30, 40, 50);
    for (int row = 0; row < 3; ++row) {
      for (int column = 0; column < 5; ++column) rows.push_back(matrix(row, column));
    }
    rows.insert(rows.end(), {1.0, 9.0});
  }
  return rows;
}

std::string PosesBoundsNpy(const std::vector<double>& rows) {
  return NpyOf(NpyDict("<f8", absl::StrCat("(", rows.size() / 17, ", 17)")), BytesOf<double>(rows));
}

std::vector<Pose> SmallPoses() {
  return {{Eigen::Quaterniond(1, 0, 0, 0), {0, 0, 4}},
          {Eigen::Quaterniond(0.8, 0.6, 0, 0), {1, 2, 3}},
          {Eigen::Quaterniond(0.5, -0.5, 0.5, 0.5), {-1, 0.25, 3}}};
}

void RemoveColmap(const SmallDataset& dataset) {
  std::filesystem::remove_all(dataset.folder / "sparse");
}

}  // namespace pepeseg::testing
