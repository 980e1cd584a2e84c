#include "core/dataset/import.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <numeric>

#include "tests/testing/small_dataset.h"
#include "tests/testing/status_testing.h"

namespace pepeseg {
namespace {

using testing::SmallDataset;

TEST(ImportCapture, ReadsTheShippedScene) {
  ASSERT_OK_AND_ASSIGN(const auto files, ListDataset(PEPESEG_TEST_DATA "/apc_shelf"));
  ASSERT_OK_AND_ASSIGN(const Capture capture, ImportCapture(files, {}));
  ASSERT_EQ(capture.views.size(), 15u);
  EXPECT_EQ(capture.points.size(), 900u);
  EXPECT_THAT(capture.warnings, ::testing::IsEmpty());
  int held_out = 0;
  for (const View& view : capture.views) {
    held_out += view.held_out ? 1 : 0;
    EXPECT_EQ(view.camera.width, 640);
    EXPECT_EQ(view.camera.height, 480);
    EXPECT_EQ(view.photo.pixels.size(), 640u * 480 * 3);
    EXPECT_EQ(view.ignore.size(), 640u * 480);
    EXPECT_GE(view.masks.num_masks, 1) << view.name;
  }
  EXPECT_EQ(held_out, 2);
  EXPECT_TRUE(capture.views[0].held_out && capture.views[8].held_out);
  EXPECT_EQ(capture.views[3].name, "frame-000003.jpg");
  // The points are on the shelf, in front of the cameras, so most project into the first view.
  const View& view = capture.views[0];
  int inside = 0;
  for (const ScenePoint& point : capture.points) {
    const Eigen::Vector3d p = view.cam_from_world * point.position.cast<double>();
    const double x = view.camera.fx * p.x() / p.z() + view.camera.cx;
    const double y = view.camera.fy * p.y() / p.z() + view.camera.cy;
    inside += p.z() > 0 && x >= 0 && x < 640 && y >= 0 && y < 480 ? 1 : 0;
  }
  EXPECT_GT(inside, 600);
}

TEST(ImportCapture, SortsViewsAndKeepsPosesAndCameras) {
  SmallDataset dataset;
  dataset.Write();
  ASSERT_OK_AND_ASSIGN(const Capture capture, dataset.Import({.held_out_every = 2}));
  ASSERT_EQ(capture.views.size(), 3u);
  EXPECT_EQ(capture.views[0].name, "a.jpg");
  EXPECT_EQ(capture.views[1].name, "b.jpg");
  EXPECT_EQ(capture.views[2].name, "sub/c.png");
  EXPECT_TRUE(capture.views[0].held_out);
  EXPECT_FALSE(capture.views[1].held_out);
  EXPECT_TRUE(capture.views[2].held_out);
  const View& view = capture.views[1];
  EXPECT_DOUBLE_EQ(view.camera.fx, 50);
  EXPECT_DOUBLE_EQ(view.camera.fy, 51);
  EXPECT_DOUBLE_EQ(view.camera.cx, 21);
  EXPECT_DOUBLE_EQ(view.camera.cy, 14);
  EXPECT_DOUBLE_EQ(view.cam_from_world.rotation.w(), 0.8);
  EXPECT_DOUBLE_EQ(view.cam_from_world.rotation.x(), 0.6);
  EXPECT_EQ(view.cam_from_world.translation, Eigen::Vector3d(1, 2, 3));
  ASSERT_EQ(capture.points.size(), 2u);
  EXPECT_EQ(capture.points[0].position, Eigen::Vector3f(1, 2, 3));
  EXPECT_EQ(capture.points[0].rgb[1], 128);
  EXPECT_THAT(capture.warnings, ::testing::IsEmpty());
}

// Map coordinates, in which single precision resolves only half a metre.
TEST(ImportCapture, MovesTheOriginToCamerasFarFromZero) {
  const Eigen::Vector3d far(4e5, 5.3e6, 1e7);
  for (const bool text : {false, true}) {
    SmallDataset near, dataset;
    dataset.text = text;
    for (testing::ImageRecord& image : dataset.images) {
      const Eigen::Quaterniond rotation(image.q[0], image.q[1], image.q[2], image.q[3]);
      const Eigen::Vector3d moved = rotation * far;
      for (int k = 0; k < 3; ++k) image.t[k] -= moved[k];
    }
    for (testing::PointRecord& point : dataset.points) {
      for (int k = 0; k < 3; ++k) point.xyz[k] += far[k];
    }
    near.Write();
    dataset.Write();
    ASSERT_OK_AND_ASSIGN(const Capture want, near.Import());
    ASSERT_OK_AND_ASSIGN(const Capture capture, dataset.Import());
    EXPECT_EQ(want.origin, Eigen::Vector3d::Zero());
    EXPECT_LT((capture.origin - far).norm(), 10);
    EXPECT_THAT(capture.warnings, ::testing::ElementsAre(::testing::HasSubstr("far from zero")));
    ASSERT_EQ(capture.points.size(), want.points.size());
    for (size_t i = 0; i < capture.views.size(); ++i) {
      for (size_t k = 0; k < capture.points.size(); ++k) {
        const Eigen::Vector3d seen =
            capture.views[i].cam_from_world * capture.points[k].position.cast<double>();
        const Eigen::Vector3d at =
            want.views[i].cam_from_world * want.points[k].position.cast<double>();
        EXPECT_LT((seen - at).norm(), 1e-5);
      }
    }
  }
}

TEST(ImportCapture, KeepsPngPhotographsAndMasksUnchanged) {
  SmallDataset dataset;
  dataset.Write();
  ASSERT_OK_AND_ASSIGN(const Capture capture, dataset.Import());
  EXPECT_EQ(capture.views[2].photo.pixels, testing::Picture(40, 30).pixels);
  EXPECT_EQ(capture.views[0].masks.mask_area, (std::vector<int64_t>{120, 60}));
  EXPECT_TRUE(capture.views[0].masks.Covers(0, 3, 29));
  EXPECT_FALSE(capture.views[0].masks.Covers(1, 3, 29));
  EXPECT_TRUE(capture.views[0].masks.Covers(1, 0, 14));
  EXPECT_TRUE(capture.views[1].masks.empty());
  for (const View& view : capture.views) {
    EXPECT_EQ(std::accumulate(view.ignore.begin(), view.ignore.end(), 0), 1);
    EXPECT_EQ(view.ignore[5], 1);
  }
}

TEST(ImportCapture, IgnoresTransparentPixels) {
  SmallDataset dataset;
  const Image picture = testing::Picture(40, 30);
  Image with_alpha = {40, 30, 4, {}};
  for (int i = 0; i < 40 * 30; ++i) {
    for (int c = 0; c < 3; ++c) with_alpha.pixels.push_back(picture.pixels[3 * i + c]);
    with_alpha.pixels.push_back(i == 77 ? 127 : i == 78 ? 128 : i == 79 ? 0 : 255);
  }
  testing::WriteBytes(dataset.folder / "images/sub/c.png", testing::Png(with_alpha));
  dataset.Write();
  ASSERT_OK_AND_ASSIGN(const Capture capture, dataset.Import());
  const View& view = capture.views[2];
  EXPECT_EQ(view.photo.pixels, picture.pixels);
  std::vector<int> ignored;
  for (int i = 0; i < 40 * 30; ++i) {
    if (view.ignore[i] != 0) ignored.push_back(i);
  }
  EXPECT_THAT(ignored, ::testing::ElementsAre(5, 77, 79));  // 5: the dataset's ignore mask
}

TEST(ImportCapture, ReadsTextAndBinaryPosesAlike) {
  SmallDataset binary, text;
  text.text = true;
  binary.Write();
  text.Write();
  ASSERT_OK_AND_ASSIGN(const Capture a, binary.Import());
  ASSERT_OK_AND_ASSIGN(const Capture b, text.Import());
  ASSERT_EQ(a.views.size(), b.views.size());
  for (size_t i = 0; i < a.views.size(); ++i) {
    EXPECT_EQ(a.views[i].name, b.views[i].name);
    EXPECT_EQ(a.views[i].camera.fx, b.views[i].camera.fx);
    EXPECT_EQ(a.views[i].camera.cy, b.views[i].camera.cy);
    EXPECT_EQ(a.views[i].cam_from_world.rotation.coeffs(),
              b.views[i].cam_from_world.rotation.coeffs());
    EXPECT_EQ(a.views[i].cam_from_world.translation, b.views[i].cam_from_world.translation);
  }
  ASSERT_EQ(a.points.size(), b.points.size());
  for (size_t i = 0; i < a.points.size(); ++i) {
    EXPECT_EQ(a.points[i].position, b.points[i].position);
    EXPECT_EQ(a.points[i].rgb[0], b.points[i].rgb[0]);
  }
}

TEST(ImportCapture, ShrinksPhotographsCamerasAndMasksAlike) {
  SmallDataset dataset;
  dataset.Write();
  ASSERT_OK_AND_ASSIGN(const Capture capture, dataset.Import({.image_scale = 0.5}));
  const View& view = capture.views[2];
  EXPECT_EQ(view.camera.width, 20);
  EXPECT_EQ(view.camera.height, 15);
  EXPECT_DOUBLE_EQ(view.camera.fx, 25);
  EXPECT_DOUBLE_EQ(view.camera.cy, 7);
  const Image full = testing::Picture(40, 30);
  ASSERT_EQ(view.photo.pixels.size(), 20u * 15 * 3);
  for (int i = 0; i < 3; ++i) {  // pixel (4, 6) is the mean of four
    const auto at = [&](int x, int y) { return full.pixels[3 * (40 * y + x) + i]; };
    const double mean = (at(8, 12) + at(9, 12) + at(8, 13) + at(9, 13)) / 4.0;
    EXPECT_NEAR(view.photo.pixels[3 * (20 * 6 + 4) + i], mean, 0.51);
  }
  EXPECT_EQ(capture.views[0].masks.mask_area, (std::vector<int64_t>{30, 14}));
  EXPECT_EQ(view.ignore[2], 1);
}

TEST(ImportCapture, WarnsOfFilesWithoutACounterpart) {
  SmallDataset dataset;
  dataset.images[0].name = "gone.jpg";
  dataset.Write();
  testing::WriteBytes(dataset.folder / "masks/nobody.json", "[]");
  ASSERT_OK_AND_ASSIGN(const Capture capture, dataset.Import());
  EXPECT_EQ(capture.views.size(), 2u);
  EXPECT_THAT(capture.warnings,
              ::testing::UnorderedElementsAre(
                  ::testing::HasSubstr("1 photographs have no pose and are left out: images/a.jpg"),
                  ::testing::HasSubstr("1 poses have no photograph and are left out: gone.jpg"),
                  ::testing::HasSubstr("masks/nobody.json")));
}

TEST(ImportCapture, ScalesTheCameraOfPhotographsThatWereShrunk) {
  SmallDataset dataset;
  dataset.cameras[0].width = 80;
  dataset.cameras[0].height = 60;
  dataset.Write();
  ASSERT_OK_AND_ASSIGN(const Capture capture, dataset.Import());
  EXPECT_DOUBLE_EQ(capture.views[0].camera.fx, 25);
  EXPECT_DOUBLE_EQ(capture.views[0].camera.cx, 10.5);
  EXPECT_THAT(capture.warnings, ::testing::ElementsAre(::testing::HasSubstr("another size")));
}

TEST(ImportCapture, UndistortsPhotographMasksAndIgnoreMask) {
  SmallDataset dataset;
  dataset.cameras = {{1, 3, "RADIAL", 40, 30, {45, 20, 15, 0.3, 0.05}}};
  dataset.Write();
  ASSERT_OK_AND_ASSIGN(const Capture capture, dataset.Import());
  const View& view = capture.views[0];
  // The photograph shows less than a pinhole of its size would, so the frame is cropped.
  EXPECT_LT(view.camera.width, 40);
  EXPECT_LT(view.camera.height, 30);
  EXPECT_DOUBLE_EQ(view.camera.fx, 45);
  EXPECT_EQ(view.photo.width, view.camera.width);
  EXPECT_EQ(view.masks.width, view.camera.width);
  EXPECT_EQ(view.ignore.size(), static_cast<size_t>(view.camera.width) * view.camera.height);
}

TEST(ImportCapture, RecordsTheLensAndTheRectangleOfThePhotograph) {
  SmallDataset dataset;
  // The photograph is half as large as its camera.
  dataset.cameras = {{1, 3, "RADIAL", 80, 60, {90, 40, 30, 0.3, 0.05}}};
  dataset.Write();
  ASSERT_OK_AND_ASSIGN(const Capture capture, dataset.Import({.image_scale = 0.5}));
  for (const View& view : capture.views) {
    ASSERT_TRUE(view.photograph.has_value());
    const Photograph& photograph = *view.photograph;
    EXPECT_OK(Validate(photograph));
    EXPECT_EQ(photograph.lens.model, LensModel::kRadial);
    EXPECT_EQ(photograph.lens.width, 40);
    EXPECT_EQ(photograph.lens.height, 30);
    EXPECT_DOUBLE_EQ(photograph.lens.fx, 45);
    EXPECT_DOUBLE_EQ(photograph.lens.distortion[0], 0.3);
    EXPECT_EQ(photograph.orientation, 1);
    EXPECT_EQ(view.camera.width, std::lround(photograph.width * 0.5));
    EXPECT_DOUBLE_EQ(view.camera.cx * photograph.width / view.camera.width,
                     photograph.lens.cx - photograph.left);
  }
}

TEST(ImportCapture, RecordsTheExifOrientation) {
  SmallDataset dataset;
  dataset.Write();
  // An APP1 segment with a TIFF structure of one entry: orientation 6.
  const std::string exif(
      "\xff\xe1\0\x22"
      "Exif\0\0MM\0*\0\0\0\x08\0\x01\x01\x12\0\x03\0\0\0\x01\0\x06\0\0\0\0\0\0",
      36);
  std::string jpeg = testing::ReadBytes(dataset.folder / "images/a.jpg");
  jpeg.insert(2, exif);
  testing::WriteBytes(dataset.folder / "images/a.jpg", jpeg);
  ASSERT_OK_AND_ASSIGN(const Capture capture, dataset.Import());
  EXPECT_EQ(capture.views[0].photograph->orientation, 6);
  EXPECT_EQ(capture.views[1].photograph->orientation, 1);
  // Poses belong to the stored pixels.
  EXPECT_EQ(capture.views[0].photo.width, 40);
}

// A dataset with a distorting lens, masks of b.jpg and depth of a.jpg.
struct DatasetWithPriors : SmallDataset {
  DatasetWithPriors() {
    cameras = {{1, 2, "SIMPLE_RADIAL", 40, 30, {50, 20, 15, 0.1}}};
    testing::WriteBytes(folder / "masks/b.png", testing::Png(Labels(40, 30)));
    testing::WriteBytes(folder / "depth/a.png", testing::Png(Labels(40, 30)));
    Write();
  }
  static Image Labels(int width, int height) {
    Image image{width, height, 1, {}};
    for (int i = 0; i < width * height; ++i) {
      image.pixels.push_back(static_cast<uint8_t>(i % width / 4 + 1));
    }
    return image;
  }
  static bool IsPrior(const DatasetFile& file) {
    return file.kind == FileKind::kMask || file.kind == FileKind::kDepth;
  }
};

TEST(ImportCapture, LeavesMasksAndDepthOutOnRequest) {
  const DatasetWithPriors dataset;
  ASSERT_OK_AND_ASSIGN(const Capture used, dataset.Import());
  EXPECT_FALSE(used.views[1].masks.empty());
  EXPECT_FALSE(used.views[0].depth.values.empty());
  ASSERT_OK_AND_ASSIGN(const Capture capture,
                       dataset.Import({.use_masks = false, .use_depth = false}));
  for (const View& view : capture.views) {
    EXPECT_TRUE(view.masks.empty());
    EXPECT_TRUE(view.depth.values.empty());
    EXPECT_FALSE(view.ignore.empty());
  }
  EXPECT_THAT(capture.warnings,
              ::testing::ElementsAre("the masks of 2 photographs are left out: import.use_masks is "
                                     "false",
                                     "the depth maps of 1 photographs are left out: "
                                     "import.use_depth is false"));
}

TEST(ImportPriors, EqualsAnImportThatIncludesTheFiles) {
  const DatasetWithPriors dataset;
  ASSERT_OK_AND_ASSIGN(std::vector<DatasetFile> files, ListDataset(dataset.folder.path()));
  ASSERT_OK_AND_ASSIGN(const Capture whole, ImportCapture(files, {.image_scale = 0.5}));
  std::vector<DatasetFile> priors;
  std::copy_if(files.begin(), files.end(), std::back_inserter(priors), &DatasetWithPriors::IsPrior);
  ASSERT_EQ(priors.size(), 3u);
  std::erase_if(files, &DatasetWithPriors::IsPrior);
  ASSERT_OK_AND_ASSIGN(Capture capture, ImportCapture(files, {.image_scale = 0.5}));
  // Fails if the photographs are read again.
  for (const char* name : {"a.jpg", "b.jpg", "sub/c.png"}) {
    std::filesystem::remove(dataset.folder / "images" / name);
  }
  ASSERT_OK_AND_ASSIGN(const std::vector<std::string> warnings, ImportPriors(priors, capture));
  EXPECT_THAT(warnings, ::testing::ElementsAre(::testing::HasSubstr("too few points to check")));
  ASSERT_EQ(capture.views.size(), 3u);
  EXPECT_GT(capture.views[1].masks.num_masks, 3);
  for (size_t i = 0; i < capture.views.size(); ++i) {
    const View &made = capture.views[i], &given = whole.views[i];
    EXPECT_EQ(made.masks.pixel_cell, given.masks.pixel_cell) << made.name;
    EXPECT_EQ(made.masks.cell_bits, given.masks.cell_bits) << made.name;
    EXPECT_EQ(made.depth.kind, given.depth.kind) << made.name;
    ASSERT_EQ(made.depth.values.size(), given.depth.values.size()) << made.name;
    for (size_t k = 0; k < given.depth.values.size(); ++k) {
      const float a = made.depth.values[k], b = given.depth.values[k];
      EXPECT_TRUE(a == b || (std::isnan(a) && std::isnan(b))) << made.name << ", pixel " << k;
    }
  }
}

TEST(ImportPriors, LeavesTheCaptureUnchangedOnError) {
  const DatasetWithPriors dataset;
  ASSERT_OK_AND_ASSIGN(std::vector<DatasetFile> files, ListDataset(dataset.folder.path()));
  std::vector<DatasetFile> priors;
  std::copy_if(files.begin(), files.end(), std::back_inserter(priors), &DatasetWithPriors::IsPrior);
  std::erase_if(files, &DatasetWithPriors::IsPrior);
  ASSERT_OK_AND_ASSIGN(Capture capture, ImportCapture(files, {}));
  testing::WriteBytes(dataset.folder / "masks/b.png",
                      testing::Png(DatasetWithPriors::Labels(30, 40)));
  EXPECT_STATUS(ImportPriors(priors, capture), absl::StatusCode::kInvalidArgument, "masks/b.png");
  for (const View& view : capture.views) {
    EXPECT_TRUE(view.masks.empty() && view.depth.values.empty()) << view.name;
  }
}

}  // namespace
}  // namespace pepeseg
