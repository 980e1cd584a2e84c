#include <gtest/gtest.h>

#include <limits>

#include "core/dataset/import.h"
#include "tests/testing/small_dataset.h"
#include "tests/testing/status_testing.h"

// Datasets that the import must reject, with what the error must name.
namespace pepeseg {
namespace {

using absl::StatusCode::kInvalidArgument;
using testing::ReadBytes;
using testing::SmallDataset;
using testing::WriteBytes;

TEST(ImportCapture, RejectsATruncatedJpeg) {
  SmallDataset dataset;
  dataset.Write();
  const std::string good = ReadBytes(dataset.folder / "images/b.jpg");
  WriteBytes(dataset.folder / "images/b.jpg", good.substr(0, good.size() * 2 / 3));
  EXPECT_STATUS(dataset.Import(), kInvalidArgument, "images/b.jpg: the JPEG file is cut short");
}

TEST(ImportCapture, RejectsABillionDeclaredImages) {
  SmallDataset dataset;
  dataset.Write();
  std::string bytes = ReadBytes(dataset.folder / "sparse/0/images.bin");
  const uint64_t billion = 1'000'000'000;
  bytes.replace(0, 8, reinterpret_cast<const char*>(&billion), 8);
  WriteBytes(dataset.folder / "sparse/0/images.bin", bytes);
  EXPECT_STATUS(dataset.Import(), kInvalidArgument, "sparse/0/images.bin: declares 1000000000");
}

TEST(ImportCapture, RejectsAMaskOfAnotherShape) {
  SmallDataset dataset;
  WriteBytes(dataset.folder / "masks/a.json",
             R"([{"segmentation": {"size": [640, 480], "counts": [307200]}}])");
  dataset.Write();
  EXPECT_STATUS(dataset.Import(), kInvalidArgument,
                "masks/a.json: mask 0: has 480x640 pixels, its photograph images/a.jpg has 40x30: "
                "not of one shape");
}

TEST(ImportCapture, RejectsAnIgnoreMaskOfAnotherShape) {
  SmallDataset dataset;
  WriteBytes(dataset.folder / "ignore_mask.png",
             testing::Png({2, 2, 1, std::vector<uint8_t>(4, 1)}));
  dataset.Write();
  EXPECT_STATUS(dataset.Import(), kInvalidArgument, "ignore_mask.png: has 2x2 pixels");
}

TEST(ImportCapture, RejectsPosesThatAreNotNumbers) {
  SmallDataset dataset;
  dataset.images[1].t[2] = std::numeric_limits<double>::quiet_NaN();
  dataset.Write();
  EXPECT_STATUS(dataset.Import(), kInvalidArgument,
                "sparse/0/images.bin: image 1 (images/b.jpg): the pose is not finite");
}

TEST(ImportCapture, RejectsAnImageOutsideOfItsFolder) {
  SmallDataset dataset;
  dataset.images[0].name = "../../x";
  dataset.Write();
  EXPECT_STATUS(dataset.Import(), kInvalidArgument, "\"../../x\"");
  const std::vector<DatasetFile> files = {{FileKind::kImage, "../../x", dataset.folder / "x"}};
  EXPECT_STATUS(ImportCapture(files, {}), kInvalidArgument, "\"../../x\"");
}

TEST(ImportCapture, RejectsAnEmptyDataset) {
  const testing::TempFolder folder;
  EXPECT_STATUS(ListDataset(folder.path()), kInvalidArgument, "no photographs");
  EXPECT_STATUS(ImportCapture({}, {}), kInvalidArgument, "no photographs among the files");
}

TEST(ImportCapture, RejectsADatasetWithoutPoses) {
  SmallDataset dataset;
  dataset.Write();
  std::filesystem::remove(dataset.folder / "sparse/0/images.bin");
  EXPECT_STATUS(dataset.Import(), kInvalidArgument, "no poses among the files");
}

TEST(ImportCapture, RejectsFewerThanTwoViews) {
  SmallDataset dataset;
  dataset.images[0].name = "x.jpg";
  dataset.images[1].name = "y.jpg";
  dataset.Write();
  EXPECT_STATUS(dataset.Import(), kInvalidArgument, "1 of 3 photographs have a pose");
}

TEST(ImportCapture, RejectsAPhotographOfAnotherShapeThanItsCamera) {
  SmallDataset dataset;
  dataset.cameras[0].width = 30;
  dataset.cameras[0].height = 40;
  dataset.Write();
  EXPECT_STATUS(dataset.Import(), kInvalidArgument,
                "images/a.jpg: 40x30 pixels, its camera has 30x40");
}

TEST(ImportCapture, RejectsAnImageWithoutItsCamera) {
  SmallDataset dataset;
  dataset.images[2].camera_id = 77;
  dataset.Write();
  EXPECT_STATUS(dataset.Import(), kInvalidArgument, "sub/c.png has the camera 77");
}

TEST(ImportCapture, RejectsTwoPosesOrFilesForOnePhotograph) {
  SmallDataset poses;
  poses.images[1].name = "images/a.jpg";
  poses.Write();
  EXPECT_STATUS(poses.Import(), kInvalidArgument, "two poses for the photograph a.jpg");
  SmallDataset masks;
  WriteBytes(masks.folder / "masks/a.png",
             testing::Png({40, 30, 1, std::vector<uint8_t>(1200, 1)}));
  masks.Write();
  EXPECT_STATUS(masks.Import(), kInvalidArgument, "masks/a.json and masks/a.png");
}

TEST(ImportCapture, RejectsTwoFilesOfGaussians) {
  SmallDataset dataset;
  dataset.Write();
  ASSERT_OK_AND_ASSIGN(std::vector<DatasetFile> files, ListDataset(dataset.folder.path()));
  files.push_back({FileKind::kGaussians, "a.ply", dataset.folder / "a.ply"});
  EXPECT_OK(ImportCapture(files, {}));
  files.push_back({FileKind::kGaussians, "b.ply", dataset.folder / "b.ply"});
  EXPECT_STATUS(ImportCapture(files, {}), kInvalidArgument,
                "two files of Gaussians: a.ply and b.ply");
}

TEST(ImportCapture, RejectsAMaskThatCouldBelongToTwoPhotographs) {
  SmallDataset dataset;
  WriteBytes(dataset.folder / "images/a.png", testing::Png(testing::Picture(40, 30)));
  dataset.images.push_back({9, {1, 0, 0, 0}, {0, 0, 0}, 1, "a.png", 0});
  dataset.Write();
  EXPECT_STATUS(dataset.Import(), kInvalidArgument,
                "masks/a.json could belong to a.jpg and to a.png");
}

TEST(ImportOptions, AreChecked) {
  EXPECT_OK(Validate(ImportOptions{}));
  EXPECT_STATUS(Validate(ImportOptions{.image_scale = 0}), kInvalidArgument, "image_scale");
  EXPECT_STATUS(Validate(ImportOptions{.image_scale = 1.5}), kInvalidArgument, "image_scale");
  EXPECT_STATUS(Validate(ImportOptions{.image_scale = std::nan("")}), kInvalidArgument,
                "image_scale");
  EXPECT_STATUS(Validate(ImportOptions{.held_out_every = 1}), kInvalidArgument, "held_out_every");
}

}  // namespace
}  // namespace pepeseg
