#include "core/dataset/photo_poses.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>

#include "core/dataset/import.h"
#include "tests/core/dataset/pose_files.h"
#include "tests/testing/float_files.h"
#include "tests/testing/status_testing.h"

namespace pepeseg {
namespace {

using absl::StatusCode::kInvalidArgument;
using testing::NpyDict;
using testing::NpyOf;
using testing::PosesBoundsNpy;
using testing::SmallDataset;

class PosesBoundsTest : public ::testing::Test {
 protected:
  PosesBoundsTest() : rows_(testing::PosesBoundsRows(testing::SmallPoses())) {
    dataset_.Write();
    testing::RemoveColmap(dataset_);
  }

  absl::StatusOr<Capture> ImportBytes(const std::string& bytes) {
    testing::WriteBytes(dataset_.folder / "poses_bounds.npy", bytes);
    return dataset_.Import();
  }
  absl::StatusOr<Capture> Import() { return ImportBytes(PosesBoundsNpy(rows_)); }

  SmallDataset dataset_;
  std::vector<double> rows_;
};

TEST_F(PosesBoundsTest, RoundTripsPoses) {
  ASSERT_OK_AND_ASSIGN(const Capture capture, Import());
  const std::vector<Pose> wanted = testing::SmallPoses();
  ASSERT_EQ(capture.views.size(), wanted.size());
  for (size_t i = 0; i < wanted.size(); ++i) {
    const Pose& pose = capture.views[i].cam_from_world;
    EXPECT_LT(pose.rotation.angularDistance(wanted[i].rotation), 1e-7) << i;
    EXPECT_LT((pose.translation - wanted[i].translation).norm(), 1e-12) << i;
    EXPECT_EQ(capture.views[i].camera.fx, 50);
    EXPECT_EQ(capture.views[i].camera.fy, 50);
    EXPECT_EQ(capture.views[i].camera.cx, 20);
    EXPECT_EQ(capture.views[i].camera.cy, 15);
  }
  EXPECT_THAT(capture.warnings, ::testing::IsEmpty());
}

TEST_F(PosesBoundsTest, FitsTheLensToShrunkPhotographs) {
  for (size_t row = 0; row < 3; ++row) {
    rows_[row * 17 + 4] = 120, rows_[row * 17 + 9] = 160, rows_[row * 17 + 14] = 200;
  }
  ASSERT_OK_AND_ASSIGN(const Capture capture, Import());
  EXPECT_EQ(capture.views[0].camera.fx, 50);
  EXPECT_THAT(capture.warnings, ::testing::ElementsAre(::testing::HasSubstr("another size")));
}

TEST_F(PosesBoundsTest, RejectsAnotherNumberOfPhotographs) {
  rows_.resize(2 * 17);
  EXPECT_STATUS(Import(), kInvalidArgument, "poses_bounds.npy: has 2 poses for 3 photographs");
  rows_.resize(4 * 17, 1);
  EXPECT_STATUS(Import(), kInvalidArgument, "poses_bounds.npy: has 4 poses for 3 photographs");
}

TEST_F(PosesBoundsTest, RejectsAnotherShape) {
  const std::string bytes = testing::BytesOf<double>(rows_);
  EXPECT_STATUS(ImportBytes(NpyOf(NpyDict("<f8", "(17, 3)"), bytes)), kInvalidArgument,
                "has 3 numbers per photograph, LLFF's have 17");
  EXPECT_STATUS(ImportBytes(NpyOf(NpyDict("<f8", "(3, 17, 1)"), bytes)), kInvalidArgument, "shape");
  EXPECT_STATUS(ImportBytes(NpyOf(NpyDict("<f8", "(4000000000, 17)"), bytes)), kInvalidArgument,
                "the limit is");
  EXPECT_STATUS(ImportBytes(NpyOf(NpyDict("<f8", "(300000, 17)"), bytes)), kInvalidArgument,
                "cut short");
}

TEST_F(PosesBoundsTest, RejectsAFileCutShort) {
  const std::string bytes = PosesBoundsNpy(rows_);
  for (const size_t size : {size_t{0}, size_t{7}, size_t{40}, bytes.size() - 1}) {
    EXPECT_STATUS(ImportBytes(bytes.substr(0, size)), kInvalidArgument, "poses_bounds.npy");
  }
}

TEST_F(PosesBoundsTest, NamesTheInvalidPose) {
  const auto with = [&](size_t place, double value) {
    std::vector<double> rows = rows_;
    rows[17 + place] = value;
    return ImportBytes(PosesBoundsNpy(rows));
  };
  const std::string row = "poses_bounds.npy: row 1 (b.jpg): ";
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_STATUS(with(1, kNan), kInvalidArgument, row + "the pose is not finite");
  EXPECT_STATUS(with(3, kNan), kInvalidArgument, row + "the pose is not finite");
  EXPECT_STATUS(with(5, 7), kInvalidArgument, row + "the axes");
  EXPECT_STATUS(with(4, kNan), kInvalidArgument, row + "height nan");
  EXPECT_STATUS(with(4, 30.5), kInvalidArgument, row + "height 30.5");
  EXPECT_STATUS(with(9, -40), kInvalidArgument, row + "height 30 and width -40");
  EXPECT_STATUS(with(14, kNan), kInvalidArgument, row);
  EXPECT_STATUS(with(14, 0), kInvalidArgument, row);
}

TEST_F(PosesBoundsTest, RejectsMirroredAxes) {
  for (size_t axis = 0; axis < 3; ++axis) rows_[axis * 5] = -rows_[axis * 5];
  EXPECT_STATUS(Import(), kInvalidArgument, "row 0 (a.jpg): the axes of the camera are mirrored");
}

}  // namespace
}  // namespace pepeseg
