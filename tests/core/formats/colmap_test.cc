#include "core/formats/colmap.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "tests/testing/colmap_files.h"
#include "tests/testing/small_dataset.h"
#include "tests/testing/status_testing.h"

namespace pepeseg {
namespace {

using absl::StatusCode::kInvalidArgument;
using testing::CameraRecord;
using testing::CamerasBinary;
using testing::CamerasText;
using testing::ImageRecord;
using testing::ImagesBinary;
using testing::ImagesText;
using testing::PointRecord;
using testing::PointsBinary;
using testing::PointsText;
using testing::TempFolder;
using testing::WriteBytes;

std::vector<CameraRecord> CamerasOfAllModels() {
  std::vector<CameraRecord> cameras;
  for (int model = 0; model < kNumLensModels; ++model) {
    const auto lens = static_cast<LensModel>(model);
    CameraRecord camera{10u + model, model, std::string(NameOf(lens)), 640, 480, {}};
    for (int i = 0; i < NumParameters(lens); ++i) camera.parameters.push_back(1.5 + i + model);
    cameras.push_back(camera);
  }
  return cameras;
}

TEST(ColmapCameras, AreEqualInBothFormsForEveryModel) {
  const TempFolder folder;
  const std::vector<CameraRecord> records = CamerasOfAllModels();
  WriteBytes(folder / "cameras.bin", CamerasBinary(records));
  WriteBytes(folder / "cameras.txt", CamerasText(records));
  for (const std::string name : {"cameras.bin", "cameras.txt"}) {
    ASSERT_OK_AND_ASSIGN(const ColmapCameras cameras, ReadColmapCameras(folder / name, name));
    ASSERT_EQ(cameras.by_id.size(), records.size());
    for (const CameraRecord& record : records) {
      const Lens& lens = cameras.by_id.at(record.id);
      const Lens expected =
          MakeLens(static_cast<LensModel>(record.model), 640, 480, record.parameters.data());
      EXPECT_EQ(lens.model, expected.model);
      EXPECT_EQ(lens.width, 640);
      EXPECT_EQ(lens.height, 480);
      EXPECT_EQ(lens.fx, expected.fx);
      EXPECT_EQ(lens.fy, expected.fy);
      EXPECT_EQ(lens.cx, expected.cx);
      EXPECT_EQ(lens.cy, expected.cy);
      EXPECT_EQ(lens.distortion, expected.distortion);
    }
  }
}

TEST(ColmapCameras, AreRejectedNamingFileRecordAndReason) {
  const TempFolder folder;
  const auto expect_refused = [&](const CameraRecord& record, const std::string& why) {
    WriteBytes(folder / "cameras.bin", CamerasBinary({record}));
    WriteBytes(folder / "cameras.txt", CamerasText({record}));
    EXPECT_STATUS(ReadColmapCameras(folder / "cameras.bin", "s/cameras.bin"), kInvalidArgument,
                  why);
    EXPECT_STATUS(ReadColmapCameras(folder / "cameras.bin", "s/cameras.bin"), kInvalidArgument,
                  "s/cameras.bin");
    EXPECT_STATUS(ReadColmapCameras(folder / "cameras.txt", "s/cameras.txt"), kInvalidArgument,
                  why);
    EXPECT_STATUS(ReadColmapCameras(folder / "cameras.txt", "s/cameras.txt"), kInvalidArgument,
                  "s/cameras.txt");
  };
  const CameraRecord good{1, 1, "PINHOLE", 640, 480, {500, 500, 320, 240}};
  CameraRecord bad = good;
  bad.model = 99, bad.model_name = "MAGIC";
  expect_refused(bad, "unknown camera model");
  bad = good;
  bad.parameters[0] = -3;
  expect_refused(bad, "focal length");
  bad = good;
  bad.parameters[2] = std::numeric_limits<double>::infinity();
  expect_refused(bad, "not finite");
  bad = good;
  bad.width = 0;
  expect_refused(bad, "0x480");
  WriteBytes(folder / "cameras.bin", CamerasBinary({good, good}));
  EXPECT_STATUS(ReadColmapCameras(folder / "cameras.bin", "c.bin"), kInvalidArgument,
                "the camera id 1 occurs twice");
}

TEST(ColmapImages, AreEqualInBothForms) {
  const TempFolder folder;
  const std::vector<ImageRecord> records = {
      {7, {0.5, -0.5, 0.5, 0.5}, {1, -2, 3.25}, 2, "a b.jpg", 5},
      {1, {1, 0, 0, 0}, {0, 0, 0}, 1, "x/y.png", 0},
  };
  WriteBytes(folder / "images.bin", ImagesBinary(records));
  WriteBytes(folder / "images.txt", ImagesText(records));
  for (const std::string name : {"images.bin", "images.txt"}) {
    ASSERT_OK_AND_ASSIGN(const auto images, ReadColmapImages(folder / name, name));
    ASSERT_EQ(images.size(), 2u);
    EXPECT_EQ(images[0].id, 7u);
    EXPECT_EQ(images[0].camera_id, 2u);
    EXPECT_EQ(images[0].name, "a b.jpg");
    EXPECT_EQ(images[1].name, "x/y.png");
    EXPECT_EQ(images[0].cam_from_world.translation, Eigen::Vector3d(1, -2, 3.25));
    EXPECT_EQ(images[0].cam_from_world.rotation.y(), 0.5);
  }
}

TEST(ColmapImages, HaveNormalisedRotations) {
  const TempFolder folder;
  WriteBytes(folder / "images.txt", ImagesText({{1, {0.9, 0, 0.9, 0}, {0, 0, 0}, 1, "a.jpg", 0}}));
  ASSERT_OK_AND_ASSIGN(const auto images, ReadColmapImages(folder / "images.txt", "images.txt"));
  EXPECT_NEAR(images[0].cam_from_world.rotation.norm(), 1, 1e-15);
  EXPECT_NEAR(images[0].cam_from_world.rotation.w(), std::sqrt(0.5), 1e-15);
}

TEST(ColmapImages, AreRejectedNamingFileRecordAndReason) {
  const TempFolder folder;
  const auto expect_refused = [&](const ImageRecord& record, const std::string& why) {
    const ImageRecord good{1, {1, 0, 0, 0}, {0, 0, 0}, 1, "good.jpg", 0};
    WriteBytes(folder / "images.bin", ImagesBinary({good, record}));
    WriteBytes(folder / "images.txt", ImagesText({good, record}));
    EXPECT_STATUS(ReadColmapImages(folder / "images.bin", "i.bin"), kInvalidArgument, why);
    EXPECT_STATUS(ReadColmapImages(folder / "images.bin", "i.bin"), kInvalidArgument, "i.bin");
    EXPECT_STATUS(ReadColmapImages(folder / "images.txt", "i.txt"), kInvalidArgument, why);
    EXPECT_STATUS(ReadColmapImages(folder / "images.txt", "i.txt"), kInvalidArgument, "i.txt");
  };
  const double nan = std::numeric_limits<double>::quiet_NaN();
  expect_refused({2, {nan, 0, 0, 0}, {0, 0, 0}, 1, "bad.jpg", 0},
                 "(bad.jpg): the pose is not finite");
  expect_refused({2, {1, 0, 0, 0}, {0, nan, 0}, 1, "bad.jpg", 0},
                 "(bad.jpg): the pose is not finite");
  expect_refused({2, {0, 0, 0, 0}, {0, 0, 0}, 1, "bad.jpg", 0}, "norm 0");
  expect_refused({2, {100, 0, 0, 0}, {0, 0, 0}, 1, "bad.jpg", 0}, "norm 100");
  expect_refused({2, {1, 0, 0, 0}, {0, 0, 0}, 1, "../../x", 0}, "\"../../x\"");
  expect_refused({2, {1, 0, 0, 0}, {0, 0, 0}, 1, "/etc/passwd", 0}, "absolute");
  expect_refused({1, {1, 0, 0, 0}, {0, 0, 0}, 1, "bad.jpg", 0}, "the image id 1 occurs twice");
  expect_refused({2, {1, 0, 0, 0}, {0, 0, 0}, 1, "good.jpg", 0}, "good.jpg occurs twice");
}

TEST(ColmapImages, AreRejectedAtOnceIfTheFileDeclaresMoreThanItHolds) {
  const TempFolder folder;
  const ImageRecord image{1, {1, 0, 0, 0}, {0, 0, 0}, 1, "a.jpg", 0};
  const auto with_count = [&](uint64_t count, size_t at) {
    std::string bytes = ImagesBinary({image});
    bytes.replace(at, 8, reinterpret_cast<const char*>(&count), 8);
    WriteBytes(folder / "images.bin", bytes);
    return ReadColmapImages(folder / "images.bin", "images.bin");
  };
  EXPECT_STATUS(with_count(1'000'000'000, 0), kInvalidArgument,
                "images.bin: declares 1000000000 images, the limit is 10000");
  EXPECT_STATUS(with_count(9'000, 0), kInvalidArgument,
                "declares 9000 images of at least 73 bytes");
  const size_t num_points = ImagesBinary({image}).size() - 8;
  EXPECT_STATUS(with_count(~uint64_t{0} / 24 + 1, num_points), kInvalidArgument,
                "image 0: declares");
}

TEST(ColmapPoints, AreEqualInBothForms) {
  const TempFolder folder;
  const std::vector<PointRecord> records = {{4, {1.5, 2, -3}, {255, 0, 7}, 3},
                                            {5, {0, 0, 1}, {1, 2, 3}, 0}};
  WriteBytes(folder / "points3D.bin", PointsBinary(records));
  WriteBytes(folder / "points3D.txt", PointsText(records));
  for (const std::string name : {"points3D.bin", "points3D.txt"}) {
    ASSERT_OK_AND_ASSIGN(const auto points, ReadColmapPoints(folder / name, name));
    ASSERT_EQ(points.size(), 2u);
    EXPECT_EQ(points[0].position, Eigen::Vector3f(1.5, 2, -3));
    EXPECT_EQ(points[0].rgb[0], 255);
    EXPECT_EQ(points[0].rgb[2], 7);
  }
}

TEST(ColmapPoints, AreRejectedNamingThePoint) {
  const TempFolder folder;
  const double nan = std::numeric_limits<double>::quiet_NaN();
  WriteBytes(folder / "points3D.bin",
             PointsBinary({{1, {0, 0, 0}, {}, 0}, {2, {0, nan, 0}, {}, 0}}));
  EXPECT_STATUS(ReadColmapPoints(folder / "points3D.bin", "p.bin"), kInvalidArgument,
                "p.bin: point 1: the position is not finite");
  WriteBytes(folder / "points3D.txt", "1 0 0 0 256 0 0 0.5\n");
  EXPECT_STATUS(ReadColmapPoints(folder / "points3D.txt", "p.txt"), kInvalidArgument,
                "p.txt: line 1: the colour");
  std::string bytes = PointsBinary({{1, {0, 0, 0}, {}, 0}});
  bytes.replace(0, 8, std::string("\0\0\0\0\1\0\0\0", 8));
  WriteBytes(folder / "points3D.bin", bytes);
  EXPECT_STATUS(ReadColmapPoints(folder / "points3D.bin", "p.bin"), kInvalidArgument,
                "declares 4294967296 points, the limit is 50000000");
}

}  // namespace
}  // namespace pepeseg
