#include "core/dataset/transforms_json.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/dataset/import.h"
#include "tests/core/dataset/pose_files.h"
#include "tests/testing/status_testing.h"

namespace pepeseg {
namespace {

using absl::StatusCode::kInvalidArgument;
using ::testing::ElementsAre;
using testing::FrameRecord;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using testing::SmallDataset;
using testing::TransformsJson;

constexpr char kLens[] = R"("fl_x": 50, "fl_y": 51, "cx": 21, "cy": 14, "w": 40, "h": 30)";

// A SmallDataset with transforms.json in place of COLMAP's files.
class TransformsJsonTest : public ::testing::Test {
 protected:
  TransformsJsonTest() {
    dataset_.Write();
    testing::RemoveColmap(dataset_);
    const std::vector<Pose> poses = testing::SmallPoses();
    frames_ = {{"images/a.jpg", poses[0], 1, ""},
               {"images/b.jpg", poses[1], 1, ""},
               {"images/sub/c.png", poses[2], 1, ""}};
  }

  void WriteText(const std::string& text) {
    testing::WriteBytes(dataset_.folder / "transforms.json", text);
  }
  absl::StatusOr<Capture> Import(const std::string& fields = kLens) {
    WriteText(TransformsJson(fields, frames_));
    return dataset_.Import();
  }
  // Reads only the poses.
  absl::StatusOr<PhotoPoses> Read(const std::string& fields) {
    WriteText(TransformsJson(fields, frames_));
    const auto files = ListDataset(dataset_.folder.path());
    const auto index = IndexDataset(*files);
    return ReadTransformsJson(*index);
  }
  void ExpectPoses(const Capture& capture) {
    const std::vector<Pose> wanted = testing::SmallPoses();
    ASSERT_EQ(capture.views.size(), wanted.size());
    for (size_t i = 0; i < wanted.size(); ++i) {
      const Pose& pose = capture.views[i].cam_from_world;
      EXPECT_LT(pose.rotation.angularDistance(wanted[i].rotation), 1e-7) << i;
      EXPECT_LT((pose.translation - wanted[i].translation).norm(), 1e-12) << i;
    }
  }

  SmallDataset dataset_;
  std::vector<FrameRecord> frames_;
};

TEST_F(TransformsJsonTest, RoundTripsPoses) {
  ASSERT_OK_AND_ASSIGN(const Capture capture, Import());
  ExpectPoses(capture);
  EXPECT_THAT(capture.warnings, IsEmpty());
  EXPECT_THAT(capture.points, IsEmpty());
  EXPECT_EQ(capture.views[0].name, "a.jpg");
  const Camera& camera = capture.views[2].camera;
  EXPECT_EQ(camera.width, 40);
  EXPECT_EQ(camera.fx, 50);
  EXPECT_EQ(camera.fy, 51);
  EXPECT_EQ(camera.cx, 21);
  EXPECT_EQ(camera.cy, 14);
}

TEST_F(TransformsJsonTest, MatchesAPhotographByManyPaths) {
  frames_[0].file_path = "./a";
  frames_[1].file_path = "..\\\\data\\\\images_4\\\\b.png";
  frames_[2].file_path = "/home/somebody/images/sub/c";
  ASSERT_OK_AND_ASSIGN(const Capture capture, Import());
  ExpectPoses(capture);
  EXPECT_THAT(capture.warnings, IsEmpty());
}

TEST_F(TransformsJsonTest, RejectsAPhotographOfAnotherFolder) {
  frames_[2].file_path = "images/other/c.png";
  ASSERT_OK_AND_ASSIGN(const Capture capture, Import());
  EXPECT_EQ(capture.views.size(), 2u);
  EXPECT_THAT(capture.warnings,
              ElementsAre(HasSubstr("have no pose and are left out: images/sub/c.png"),
                          HasSubstr("have no photograph and are left out: images/other/c.png")));
}

TEST_F(TransformsJsonTest, MatchesNeitherOfTwoWithoutASuffix) {
  testing::WriteBytes(dataset_.folder / "images/b.png", testing::Png(testing::Picture(40, 30)));
  frames_[1].file_path = "images/b";
  ASSERT_OK_AND_ASSIGN(const Capture capture, Import());
  EXPECT_EQ(capture.views.size(), 2u);
  EXPECT_THAT(capture.warnings[1], HasSubstr("no photograph and are left out: images/b"));
}

TEST_F(TransformsJsonTest, RemovesTheScaleOfTheAxes) {
  for (FrameRecord& frame : frames_) frame.scale = 3;
  ASSERT_OK_AND_ASSIGN(const Capture capture, Import());
  ExpectPoses(capture);
}

TEST_F(TransformsJsonTest, DerivesTheLensFromFieldOfViewAndPhotographSize) {
  ASSERT_OK_AND_ASSIGN(const Capture capture, Import(R"("camera_angle_x": 1.5707963267948966)"));
  const Camera& camera = capture.views[1].camera;
  EXPECT_NEAR(camera.fx, 20, 1e-9);
  EXPECT_NEAR(camera.fy, 20, 1e-9);
  EXPECT_EQ(camera.cx, 20);
  EXPECT_EQ(camera.cy, 15);
}

TEST_F(TransformsJsonTest, FitsTheLensToAShrunkPhotograph) {
  ASSERT_OK_AND_ASSIGN(const Capture capture,
                       Import(R"("fl_x": 100, "fl_y": 102, "cx": 42, "cy": 28, "w": 80, "h": 60)"));
  EXPECT_EQ(capture.views[0].camera.fy, 51);
  EXPECT_EQ(capture.views[0].camera.cx, 21);
  EXPECT_THAT(capture.warnings, ElementsAre(HasSubstr("another size")));
}

TEST_F(TransformsJsonTest, PrefersTheFieldsOfTheFrame) {
  frames_[1].more_fields = R"(, "fl_x": 60, "k1": 0.01, "colmap_im_id": 7)";
  ASSERT_OK_AND_ASSIGN(const PhotoPoses poses, Read(kLens));
  ASSERT_EQ(poses.lenses.size(), 2u);
  EXPECT_EQ(poses.photos[0].camera_id, poses.photos[2].camera_id);
  const Lens& lens = poses.lenses.at(poses.photos[1].camera_id);
  EXPECT_EQ(lens.fx, 60);
  EXPECT_EQ(lens.fy, 51);
  EXPECT_EQ(lens.distortion[0], 0.01);
}

TEST_F(TransformsJsonTest, ReadsOpenCvDistortion) {
  const std::string base = std::string(kLens) + R"(, "k1": 0.1, "k2": 0.2, "p1": 0.3, "p2": 0.4)";
  ASSERT_OK_AND_ASSIGN(PhotoPoses poses, Read(base));
  EXPECT_EQ(poses.lenses.at(0).model, LensModel::kOpencv);
  EXPECT_EQ(poses.lenses.at(0).distortion, (std::array<double, 8>{0.1, 0.2, 0.3, 0.4}));
  ASSERT_OK_AND_ASSIGN(poses, Read(base + R"(, "k3": 0.5, "camera_model": "PINHOLE")"));
  EXPECT_EQ(poses.lenses.at(0).model, LensModel::kFullOpencv);
  EXPECT_EQ(poses.lenses.at(0).distortion, (std::array<double, 8>{0.1, 0.2, 0.3, 0.4, 0.5}));
  ASSERT_OK_AND_ASSIGN(poses,
                       Read(base + R"(, "k3": 0.5, "k4": 0.6, "camera_model": "OPENCV_FISHEYE")"));
  EXPECT_EQ(poses.lenses.at(0).model, LensModel::kOpencvFisheye);
  EXPECT_EQ(poses.lenses.at(0).distortion, (std::array<double, 8>{0.1, 0.2, 0.5, 0.6}));
  EXPECT_STATUS(Read(base + R"(, "k4": 0.6)"), kInvalidArgument, "frame 0: \"k4\" is 0.6");
}

TEST_F(TransformsJsonTest, UndistortsTheLens) {
  ASSERT_OK_AND_ASSIGN(const Capture straight, Import());
  ASSERT_OK_AND_ASSIGN(const Capture bent, Import(std::string(kLens) + R"(, "k1": -0.2)"));
  EXPECT_NE(bent.views[0].photo.pixels, straight.views[0].photo.pixels);
}

TEST_F(TransformsJsonTest, WarnsOfWhatItIgnores) {
  ASSERT_OK_AND_ASSIGN(
      const Capture capture,
      Import(std::string(kLens) + R"(, "applied_transform": [], "ply_file_path": "pc.ply")"));
  EXPECT_THAT(capture.warnings,
              ::testing::UnorderedElementsAre(
                  HasSubstr("applied_transform is not undone"),
                  HasSubstr("its points, pc.ply (ply_file_path), are not among the files")));
}

TEST_F(TransformsJsonTest, PrefersColmapPoses) {
  dataset_.Write();
  testing::WriteBytes(dataset_.folder / "poses_bounds.npy", "no NPY");
  ASSERT_OK_AND_ASSIGN(const Capture capture, Import("\"fl_x\": 60"));
  EXPECT_EQ(capture.views[0].camera.fx, 50);
  EXPECT_THAT(capture.warnings,
              ElementsAre("the poses of sparse/0/images.bin are used, not those of transforms.json",
                          "the poses of sparse/0/images.bin are used, not those of "
                          "poses_bounds.npy"));
}

TEST_F(TransformsJsonTest, UsesItsPointsOnlyWithItsPoses) {
  testing::WriteBytes(dataset_.folder / "sparse_pc.ply",
                      "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\n"
                      "property float y\nproperty float z\nend_header\n7 8 9\n");
  ASSERT_OK_AND_ASSIGN(Capture capture,
                       Import(std::string(kLens) + R"(, "ply_file_path": "sparse_pc.ply")"));
  ASSERT_EQ(capture.points.size(), 1u);
  EXPECT_EQ(capture.points[0].position, Eigen::Vector3f(7, 8, 9));
  EXPECT_THAT(capture.warnings, IsEmpty());
  dataset_.Write();
  ASSERT_OK_AND_ASSIGN(capture, Import());
  EXPECT_EQ(capture.points.size(), 2u);
  EXPECT_THAT(capture.warnings,
              ElementsAre(HasSubstr("are used, not those of transforms.json"),
                          HasSubstr("sparse_pc.ply belongs to the poses of transforms.json")));
}

TEST_F(TransformsJsonTest, RejectsDocumentsWithoutAListOfFrames) {
  for (const char* text : {"", "{\"frames\": [", "[]", "{\"frames\": {}}", "{\"frame\": []}",
                           "{\"frames\": [{\"transform_matrix\": [[NaN]]}]}"}) {
    WriteText(text);
    EXPECT_STATUS(dataset_.Import(), kInvalidArgument, "transforms.json: ");
  }
  WriteText("{\"frames\": [3]}");
  EXPECT_STATUS(dataset_.Import(), kInvalidArgument,
                "transforms.json: frame 0: has no \"file_path");
  std::string many = "{\"frames\": [0";
  for (int i = 0; i < 10'000; ++i) many += ",0";
  WriteText(many + "]}");
  EXPECT_STATUS(dataset_.Import(), kInvalidArgument, "10001 frames, the limit is 10000");
}

TEST_F(TransformsJsonTest, RejectsInvalidPoses) {
  const auto with = [&](const std::string& matrix) {
    WriteText(absl::StrCat("{", kLens, R"(, "frames": [{"file_path": "a.jpg",)",
                           R"("transform_matrix": )", matrix, "}]}"));
    return dataset_.Import();
  };
  for (const char* matrix : {"[[1, 0, 0, 0], [0, 1, 0, 0]]", "7", "[[1, 0, 0], [0, 1, 0]]",
                             R"([[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, "1", 0]])",
                             "[[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0.1, 1]]"}) {
    EXPECT_STATUS(with(matrix), kInvalidArgument, "frame 0: has no \"transform_matrix\" of 4");
  }
  EXPECT_STATUS(with("[[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, -1, 0]]"), kInvalidArgument, "mirrored");
  EXPECT_STATUS(with("[[1, 0, 0, 0], [0, 1.1, 0, 0], [0, 0, 1, 0]]"), kInvalidArgument,
                "right angles");
  EXPECT_STATUS(with("[[1, 0.1, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0]]"), kInvalidArgument,
                "right angles");
  EXPECT_STATUS(with("[[0, 0, 0, 0], [0, 0, 0, 0], [0, 0, 0, 0]]"), kInvalidArgument, "length 0");
  EXPECT_STATUS(with("[[1, 0, 0, 1e13], [0, 1, 0, 0], [0, 0, 1, 0]]"), kInvalidArgument, "beyond");
  // A number beyond the range of double is not valid for the parser.
  EXPECT_STATUS(with("[[1, 0, 0, 1e400], [0, 1, 0, 0], [0, 0, 1, 0]]"), kInvalidArgument, "JSON");
}

TEST_F(TransformsJsonTest, RejectsInvalidLenses) {
  EXPECT_STATUS(Import("\"w\": 40"), kInvalidArgument, "neither \"fl_x\" nor \"camera_angle_x\"");
  EXPECT_STATUS(Import("\"camera_angle_x\": 4"), kInvalidArgument, "radians");
  EXPECT_STATUS(Import("\"fl_x\": \"50\""), kInvalidArgument, "\"fl_x\" is not a finite number");
  EXPECT_STATUS(Import("\"fl_x\": -50"), kInvalidArgument, "frame 0");
  EXPECT_STATUS(Import(R"("fl_x": 50, "w": 40.5)"), kInvalidArgument, "\"w\" is 40.5");
  EXPECT_STATUS(Import(R"("fl_x": 50, "w": 1e300)"), kInvalidArgument, "\"w\" is");
  EXPECT_STATUS(Import(R"("fl_x": 50, "camera_model": "EQUIRECTANGULAR")"), kInvalidArgument,
                "\"camera_model\" is EQUIRECTANGULAR");
  EXPECT_STATUS(Import(R"("fl_x": 50, "w": 30, "h": 40)"), kInvalidArgument,
                "40x30 pixels, its camera has 30x40");
}

TEST_F(TransformsJsonTest, RejectsTwoPosesForAPhotograph) {
  frames_[1].file_path = "elsewhere/a.jpg";
  EXPECT_STATUS(Import(), kInvalidArgument, "transforms.json: two poses for the photograph a.jpg");
}

TEST_F(TransformsJsonTest, RejectsDeepNesting) {
  WriteText(R"({"frames": )" + std::string(1 << 20, '['));
  EXPECT_STATUS(dataset_.Import(), kInvalidArgument,
                "transforms.json: is nested deeper than 64 levels");
}

// nerfstudio's masks say what to use.
TEST_F(TransformsJsonTest, TakesMaskPathAsWhatToKeep) {
  Image keep{40, 30, 1, std::vector<uint8_t>(40 * 30, 255)};
  keep.pixels[7] = 0;
  testing::WriteBytes(dataset_.folder / "masks/a.png", testing::Png(keep));
  std::filesystem::remove(dataset_.folder / "masks/a.json");
  std::filesystem::remove(dataset_.folder / "ignore_mask.png");
  frames_[0].more_fields = R"(, "mask_path": "./masks/a.png")";
  frames_[1].more_fields = R"(, "mask_path": "masks/gone.png")";
  ASSERT_OK_AND_ASSIGN(const Capture capture, Import());
  for (const View& view : capture.views) EXPECT_TRUE(view.masks.empty()) << view.name;
  ASSERT_EQ(capture.views[0].ignore.size(), 40u * 30);
  EXPECT_EQ(capture.views[0].ignore[7], 1);
  EXPECT_EQ(capture.views[0].ignore[8], 0);
  EXPECT_THAT(capture.views[1].ignore, IsEmpty());
  EXPECT_THAT(capture.warnings, ::testing::Contains(HasSubstr("pixels of value 0 are ignored")));
  EXPECT_THAT(capture.warnings, ::testing::Contains(HasSubstr("masks/gone.png")));
}

// The file lies among the photographs, and its path is written in other letters.
TEST_F(TransformsJsonTest, TakesMasksAmongThePhotographs) {
  Image keep{40, 30, 1, std::vector<uint8_t>(40 * 30, 255)};
  keep.pixels[7] = 0;
  testing::WriteBytes(dataset_.folder / "images/a_mask.png", testing::Png(keep));
  std::filesystem::remove(dataset_.folder / "ignore_mask.png");
  frames_[0].more_fields = R"(, "mask_path": "Images/A_mask.PNG")";
  ASSERT_OK_AND_ASSIGN(const Capture capture, Import());
  ASSERT_EQ(capture.views[0].name, "a.jpg");
  ASSERT_EQ(capture.views[0].ignore.size(), 40u * 30);
  EXPECT_EQ(capture.views[0].ignore[7], 1);
  EXPECT_EQ(capture.views[0].ignore[8], 0);
  EXPECT_THAT(capture.warnings, ::testing::Not(::testing::Contains(HasSubstr("a_mask"))));
}

// One file for all frames, which COLMAP's poses do not make a segment either.
TEST_F(TransformsJsonTest, TakesTheMaskPathOfTheDocument) {
  SmallDataset dataset;
  dataset.Write();
  Image keep{40, 30, 1, std::vector<uint8_t>(40 * 30, 255)};
  keep.pixels[9] = 0;
  testing::WriteBytes(dataset.folder / "masks/all.png", testing::Png(keep));
  testing::WriteBytes(
      dataset.folder / "transforms.json",
      TransformsJson(std::string(kLens) + R"(, "mask_path": "masks/all.png")", frames_));
  ASSERT_OK_AND_ASSIGN(const Capture capture, dataset.Import());
  for (const View& view : capture.views) EXPECT_EQ(view.ignore[9], 1) << view.name;
  EXPECT_THAT(capture.warnings,
              ::testing::Not(::testing::Contains(HasSubstr("belong to no view"))));
}

TEST_F(TransformsJsonTest, StartsFromThePointsThatPlyFilePathNames) {
  const std::string ply =
      "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\n"
      "property float z\nend_header\n1 2 3\n";
  testing::WriteBytes(dataset_.folder / "pcd/fused.ply", ply);
  const std::string fields = std::string(kLens) + R"(, "ply_file_path": "./pcd/fused.ply")";
  WriteText(TransformsJson(fields, frames_));
  std::vector<DatasetFile> files = *ListDataset(dataset_.folder.path());
  ASSERT_OK_AND_ASSIGN(const Capture without, ImportCapture(files, {}));
  EXPECT_THAT(without.points, IsEmpty());
  EXPECT_THAT(without.warnings,
              ::testing::Contains(HasSubstr("pcd/fused.ply (ply_file_path), are not")));
  files.push_back({FileKind::kPoints, "pcd/fused.ply", dataset_.folder / "pcd/fused.ply"});
  files.push_back({FileKind::kPoints, "points.ply", dataset_.folder / "gone.ply"});
  ASSERT_OK_AND_ASSIGN(const Capture capture, ImportCapture(files, {}));
  EXPECT_EQ(capture.points.size(), 1u);
}

}  // namespace
}  // namespace pepeseg
