#include "core/dataset/photo_names.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/dataset/dataset_index.h"
#include "tests/testing/small_dataset.h"
#include "tests/testing/status_testing.h"

namespace pepeseg {
namespace {

using ::testing::Contains;
using ::testing::HasSubstr;
using testing::SmallDataset;
using testing::WriteBytes;

constexpr char kComposed[] = "caf\xc3\xa9.jpg", kDecomposed[] = "cafe\xcc\x81.jpg";

std::map<std::string, const DatasetFile*> Photos(const std::vector<std::string>& names) {
  std::map<std::string, const DatasetFile*> photos;
  for (const std::string& name : names) photos[name] = nullptr;
  return photos;
}

TEST(PhotoNames, FindsNamesThatDifferInSuffixCaseOrUnicodeForm) {
  const auto photos = Photos({"cam0/IMG_7.JPG", kComposed, "8.png"});
  const PhotoNames names(photos);
  EXPECT_EQ(names.Find("../data/cam0/img_7.png"), "cam0/IMG_7.JPG");
  EXPECT_EQ(names.Find("cam0/IMG_7"), "cam0/IMG_7.JPG");
  EXPECT_EQ(names.Find(kDecomposed), kComposed);
  EXPECT_EQ(names.Find("images/8.jpg"), "8.png");
  EXPECT_EQ(names.Find("C:\\data\\cam0\\IMG_7.jpg"), "cam0/IMG_7.JPG") << "written on Windows";
  EXPECT_EQ(names.Find("IMG_7.JPG"), "");
  EXPECT_EQ(names.Find("9.png"), "");
}

TEST(PhotoNames, FindsNeitherOfTwo) {
  const auto photos = Photos({"a.jpg", "A.png", "b.jpg", "B.jpg"});
  const PhotoNames names(photos);
  EXPECT_EQ(names.Find("a"), "");
  EXPECT_EQ(names.Find("a.jpg"), "a.jpg");
  EXPECT_EQ(names.Find("B.JPG"), "");
  EXPECT_EQ(names.Find("b.jpg"), "b.jpg");
}

TEST(FoldName, KeepsBytesThatAreNotUtf8) { EXPECT_EQ(FoldName("CAF\xe9"), "caf\xe9"); }

TEST(ImportCapture, MatchesPosesOfAnotherNameAndShowsBoth) {
  SmallDataset dataset;
  dataset.images[0].name = "A.JPG";
  dataset.images[1].name = "b.tif";
  dataset.Write();
  ASSERT_OK_AND_ASSIGN(const Capture capture, dataset.Import());
  EXPECT_EQ(capture.views.size(), 3u);
  EXPECT_THAT(capture.warnings, Contains(HasSubstr("A.JPG is a.jpg, b.tif is b.jpg")));
}

// Both names look alike on a screen.
TEST(ImportCapture, SaysWhereNamesDifferInUnicodeOnly) {
  SmallDataset dataset;
  dataset.images[0].name = kDecomposed;
  dataset.Write();
  std::filesystem::rename(dataset.folder / "images/a.jpg", dataset.folder / "images" / kComposed);
  ASSERT_OK_AND_ASSIGN(const Capture capture, dataset.Import());
  EXPECT_EQ(capture.views.size(), 3u);
  EXPECT_THAT(capture.warnings, Contains(HasSubstr(std::string(kDecomposed) + " is " + kComposed +
                                                   " in another form of Unicode")));
}

TEST(ImportCapture, ShowsANameOfBothKindsWhereNoneMatch) {
  SmallDataset dataset;
  for (auto& image : dataset.images) image.name = "DSC" + image.name.substr(0, 1) + ".jpg";
  dataset.Write();
  EXPECT_STATUS(dataset.Import(), absl::StatusCode::kInvalidArgument,
                "A pose is of \"DSCa.jpg\", a photograph is \"a.jpg\"");
}

TEST(ImportCapture, MatchesPosesThatWindowsHasWritten) {
  SmallDataset dataset;
  dataset.images[2].name = "sub\\c.png";
  dataset.Write();
  ASSERT_OK_AND_ASSIGN(const Capture capture, dataset.Import());
  EXPECT_EQ(capture.views.size(), 3u);
}

// A pose that names a photograph exactly keeps it.
TEST(ImportCapture, PrefersThePoseWithTheExactName) {
  SmallDataset dataset;
  dataset.images[1].name = "A.jpg";
  dataset.Write();
  ASSERT_OK_AND_ASSIGN(const Capture capture, dataset.Import());
  EXPECT_EQ(capture.views.size(), 2u);
  EXPECT_THAT(capture.warnings, Contains(HasSubstr("have no photograph and are left out: A.jpg")));
}

TEST(ImportCapture, MatchesMasksOfAnotherNameOfTheirPhotograph) {
  for (const char* name : {"masks/A.json", "masks/a.jpg.json"}) {
    SmallDataset dataset;
    dataset.Write();
    std::filesystem::rename(dataset.folder / "masks/a.json", dataset.folder / name);
    ASSERT_OK_AND_ASSIGN(const Capture capture, dataset.Import());
    EXPECT_GT(capture.views[0].masks.num_masks, 0) << name;
  }
}

TEST(ImportCapture, UsesTheColmapModelWithTheMostPhotographs) {
  SmallDataset dataset;
  const auto images = dataset.images;
  dataset.images.resize(1);
  dataset.Write();
  WriteBytes(dataset.folder / "sparse/1/cameras.bin", testing::CamerasBinary(dataset.cameras));
  WriteBytes(dataset.folder / "sparse/1/images.bin", testing::ImagesBinary(images));
  WriteBytes(dataset.folder / "sparse/10/cameras.bin", testing::CamerasBinary(dataset.cameras));
  WriteBytes(dataset.folder / "sparse/10/images.bin", "damaged");
  ASSERT_OK_AND_ASSIGN(const Capture capture, dataset.Import());
  EXPECT_EQ(capture.views.size(), 3u);
  EXPECT_TRUE(capture.points.empty());  // those of sparse/0 are in other coordinates
  EXPECT_THAT(capture.warnings,
              Contains(HasSubstr("sparse/1/images.bin is used, which has the most photographs "
                                 "(sparse/0/images.bin has 1, sparse/1/images.bin has 3, "
                                 "sparse/10/images.bin cannot be read)")));
}

TEST(ImportCapture, ReadsImagesWithoutTheLineOfPoints) {
  SmallDataset dataset;
  dataset.text = true;
  dataset.Write();
  WriteBytes(dataset.folder / "sparse/0/images.txt",
             "\xef\xbb\xbf# a byte order mark\n7 1 0 0 0 0 0 4 1 a.jpg\n"
             "3 0.8 0.6 0 0 1 2 3 1 b.jpg\n\n5 0 0 0 -1 -1 0.25 3 1 sub/c.png\n1 2 -1\n");
  WriteBytes(dataset.folder / "sparse/0/points3D.txt", "# 3D point list\n");
  ASSERT_OK_AND_ASSIGN(const Capture capture, dataset.Import());
  EXPECT_EQ(capture.views.size(), 3u);
}

TEST(ImportCapture, LeavesOutFilesOfSystems) {
  SmallDataset dataset;
  dataset.Write();
  std::vector<DatasetFile> files = *ListDataset(dataset.folder.path());
  WriteBytes(dataset.folder / "images/._a.jpg", "resource fork");
  EXPECT_EQ(ListDataset(dataset.folder.path())->size(), files.size());
  files.push_back({FileKind::kImage, "images/._a.jpg", dataset.folder / "images/._a.jpg"});
  ASSERT_OK_AND_ASSIGN(const Capture capture, ImportCapture(files, {}));
  EXPECT_EQ(capture.views.size(), 3u);
  EXPECT_THAT(capture.warnings, Contains(HasSubstr("1 files that systems leave")));
}

}  // namespace
}  // namespace pepeseg
