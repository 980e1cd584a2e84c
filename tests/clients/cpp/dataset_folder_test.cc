#include "clients/cpp/dataset_folder.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <fstream>
#include <map>

#include "tests/testing/status_testing.h"

namespace pepeseg::client {
namespace {

namespace fs = std::filesystem;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

class DatasetFolderTest : public ::testing::Test {
 protected:
  void SetUp() override {
    root_ = fs::temp_directory_path() / ("pepeseg_folder_" + std::to_string(getpid()));
    fs::remove_all(root_);
    fs::create_directories(root_);
  }
  void TearDown() override { fs::remove_all(root_); }

  void Put(const std::string& name) {
    fs::create_directories((root_ / name).parent_path());
    std::ofstream(root_ / name) << "x";
  }

  fs::path root_;
};

TEST(KindOf, FollowsTheLayoutOfADataset) {
  EXPECT_EQ(KindOf("images/a.jpg"), v1::FILE_KIND_IMAGE);
  EXPECT_EQ(KindOf("images/left/A.JPEG"), v1::FILE_KIND_IMAGE);
  EXPECT_EQ(KindOf("images/a.webp"), v1::FILE_KIND_IMAGE);
  EXPECT_EQ(KindOf("images/IMG_1.HEIC"), v1::FILE_KIND_IMAGE);
  EXPECT_EQ(KindOf("videos/walk.MP4"), v1::FILE_KIND_VIDEO);
  EXPECT_EQ(KindOf("images/walk.mov"), v1::FILE_KIND_VIDEO);
  EXPECT_EQ(KindOf("sparse/0/cameras.bin"), v1::FILE_KIND_POSES);
  EXPECT_EQ(KindOf("sparse/images.txt"), v1::FILE_KIND_POSES);
  EXPECT_EQ(KindOf("transforms.json"), v1::FILE_KIND_POSES);
  EXPECT_EQ(KindOf("poses_bounds.npy"), v1::FILE_KIND_POSES);
  EXPECT_EQ(KindOf("more/transforms.json"), std::nullopt);
  EXPECT_EQ(KindOf("sparse_pc.ply"), v1::FILE_KIND_POINTS);
  EXPECT_EQ(KindOf("sparse/0/points3D.bin"), v1::FILE_KIND_POINTS);
  EXPECT_EQ(KindOf("sparse/12/images.txt"), v1::FILE_KIND_POSES);
  EXPECT_EQ(KindOf("masks/a.json"), v1::FILE_KIND_MASK);
  EXPECT_EQ(KindOf("masks/a.png"), v1::FILE_KIND_MASK);
  EXPECT_EQ(KindOf("masks/a.npy"), v1::FILE_KIND_MASK);
  EXPECT_EQ(KindOf("masks/a/0001.png"), v1::FILE_KIND_MASK);
  EXPECT_EQ(KindOf("ignore_mask.png"), v1::FILE_KIND_IGNORE_MASK);
  EXPECT_EQ(KindOf("ignore/a.png"), v1::FILE_KIND_IGNORE_MASK);
  EXPECT_EQ(KindOf("depth/a.png"), v1::FILE_KIND_DEPTH);
  EXPECT_EQ(KindOf("disparity/a.NPY"), v1::FILE_KIND_DISPARITY);
  EXPECT_EQ(KindOf("points.ply"), v1::FILE_KIND_POINTS);
  EXPECT_EQ(KindOf("gaussians.ply"), v1::FILE_KIND_GAUSSIANS);
}

TEST(KindOf, TakesDepthForDisparityOnRequest) {
  EXPECT_EQ(KindOf("depth/a.pfm", v1::FILE_KIND_DISPARITY), v1::FILE_KIND_DISPARITY);
  EXPECT_EQ(KindOf("masks/a.png", v1::FILE_KIND_DISPARITY), v1::FILE_KIND_MASK);
}

TEST(KindOf, LeavesOutOtherFiles) {
  for (const char* name :
       {"labels/a.png", "README.md", "images/a.gif", "sparse/x/cameras.bin", "sparse/0/project.ini",
        "sparse/0", "masks/a.txt", "images.jpg", "depth/a.exr", "disparity/a.jpg"}) {
    EXPECT_FALSE(KindOf(name).has_value()) << name;
  }
}

TEST(ReadDatasetFolder, FindsAllFilesOfTheShelf) {
  const auto folder = ReadDatasetFolder(PEPESEG_TEST_DATA "/apc_shelf");
  ASSERT_OK(folder);
  std::map<v1::FileKind, int> count;
  for (const FolderFile& file : folder->files) ++count[file.kind];
  EXPECT_EQ(count[v1::FILE_KIND_IMAGE], 15);
  EXPECT_EQ(count[v1::FILE_KIND_MASK], 15);
  EXPECT_EQ(count[v1::FILE_KIND_DEPTH], 15);
  EXPECT_EQ(count[v1::FILE_KIND_POSES], 2);
  EXPECT_EQ(count[v1::FILE_KIND_POINTS], 1);
  EXPECT_EQ(count[v1::FILE_KIND_IGNORE_MASK], 1);
  EXPECT_EQ(folder->left_out.size(), 5U);  // 2 labels, LICENSE, SOURCE.md, cam.info.txt
}

TEST_F(DatasetFolderTest, SortsRelativeNames) {
  Put("sparse/0/images.bin");
  Put("images/b.jpg");
  Put("images/a.jpg");
  Put("notes.txt");
  const auto folder = ReadDatasetFolder(root_);
  ASSERT_OK(folder);
  ASSERT_EQ(folder->files.size(), 3U);
  EXPECT_EQ(folder->files[0].name, "images/a.jpg");
  EXPECT_EQ(folder->files[2].name, "sparse/0/images.bin");
  EXPECT_THAT(folder->left_out, ElementsAre("notes.txt"));
}

std::vector<std::string> NamesOf(const DatasetFolder& folder) {
  std::vector<std::string> names;
  for (const FolderFile& file : folder.files) names.push_back(file.name);
  return names;
}

TEST_F(DatasetFolderTest, TakesPhotographsAndVideosInTheFolderItself) {
  Put("b.JPG");
  Put("walk.mov");
  Put("notes.txt");
  Put("old/c.jpg");
  const auto folder = ReadDatasetFolder(root_);
  ASSERT_OK(folder);
  EXPECT_THAT(NamesOf(*folder), ElementsAre("images/b.JPG", "videos/walk.mov"));
  EXPECT_EQ(folder->files[0].path, root_ / "b.JPG");
  EXPECT_EQ(folder->files[1].kind, v1::FILE_KIND_VIDEO);
  EXPECT_THAT(folder->left_out, ElementsAre("notes.txt", "old/c.jpg"));
  // Next to images/ they are not part of the dataset.
  Put("images/a.jpg");
  const auto other = ReadDatasetFolder(root_);
  ASSERT_OK(other);
  EXPECT_THAT(NamesOf(*other), ElementsAre("images/a.jpg"));
}

TEST_F(DatasetFolderTest, TakesOneVideo) {
  Put("walk.mp4");
  const auto folder = ReadDatasetFolder(root_ / "walk.mp4");
  ASSERT_OK(folder);
  EXPECT_THAT(NamesOf(*folder), ElementsAre("videos/walk.mp4"));
  Put("walk.txt");
  EXPECT_EQ(ReadDatasetFolder(root_ / "walk.txt").status().code(), absl::StatusCode::kNotFound);
}

TEST_F(DatasetFolderTest, NamesWhatIsMissing) {
  const auto empty = ReadDatasetFolder(root_);
  EXPECT_EQ(empty.status().code(), absl::StatusCode::kInvalidArgument);
  EXPECT_THAT(std::string(empty.status().message()), HasSubstr("no photographs"));
  const auto none = ReadDatasetFolder(root_ / "nowhere");
  EXPECT_EQ(none.status().code(), absl::StatusCode::kNotFound);
}

TEST_F(DatasetFolderTest, LeavesOutFilesOfSystems) {
  for (const char* name : {"images/a.jpg", "images/._a.jpg", "images/.DS_Store", "images/Thumbs.db",
                           "__MACOSX/images/a.jpg", "images/@eaDir/a.jpg", "desktop.ini"}) {
    Put(name);
  }
  const auto folder = ReadDatasetFolder(root_);
  ASSERT_OK(folder);
  EXPECT_THAT(NamesOf(*folder), ElementsAre("images/a.jpg"));
  EXPECT_THAT(folder->left_out, ::testing::IsEmpty());
}

// The MOV of a Live Photo lies next to its photograph; another video is one.
TEST_F(DatasetFolderTest, LeavesOutTheVideosOfLivePhotos) {
  for (const char* name : {"IMG_1.HEIC", "IMG_1.MOV", "img_2.jpg", "IMG_2.mov", "walk.mp4"}) {
    Put(name);
  }
  const auto folder = ReadDatasetFolder(root_);
  ASSERT_OK(folder);
  EXPECT_THAT(NamesOf(*folder),
              ElementsAre("images/IMG_1.HEIC", "images/img_2.jpg", "videos/walk.mp4"));
  EXPECT_THAT(folder->left_out,
              ::testing::UnorderedElementsAre("videos/IMG_1.MOV", "videos/IMG_2.mov"));
}

TEST_F(DatasetFolderTest, TakesWhatTransformsJsonNames) {
  for (const char* name : {"images/a.jpg", "cloud/fused.ply", "use/a.png", "use/b.png"}) Put(name);
  std::ofstream(root_ / "transforms.json") << R"({"ply_file_path": "./cloud/fused.ply",
             "frames": [{"file_path": "images/a.jpg", "mask_path": "use\\a.png"}]})";
  const auto folder = ReadDatasetFolder(root_);
  ASSERT_OK(folder);
  EXPECT_THAT(NamesOf(*folder),
              ElementsAre("cloud/fused.ply", "images/a.jpg", "transforms.json", "use/a.png"));
  EXPECT_EQ(folder->files[0].kind, v1::FILE_KIND_POINTS);
  EXPECT_EQ(folder->files[3].kind, v1::FILE_KIND_MASK);
  EXPECT_THAT(folder->left_out, ElementsAre("use/b.png"));
}

TEST_F(DatasetFolderTest, TakesNoMaskOfTransformsJsonForALoosePhotograph) {
  for (const char* name : {"1.jpg", "2.jpg", "car.png"}) Put(name);
  std::ofstream(root_ / "transforms.json") << R"({"mask_path": "car.png"})";
  const auto folder = ReadDatasetFolder(root_);
  ASSERT_OK(folder);
  EXPECT_THAT(NamesOf(*folder),
              ElementsAre("car.png", "images/1.jpg", "images/2.jpg", "transforms.json"));
  EXPECT_EQ(folder->files[0].kind, v1::FILE_KIND_MASK);
}

// A byte order mark, as editors of Windows write it.
TEST_F(DatasetFolderTest, ReadsTransformsJsonWithAByteOrderMark) {
  Put("images/a.jpg");
  Put("cloud.ply");
  std::ofstream(root_ / "transforms.json") << "\xef\xbb\xbf"
                                              R"({"ply_file_path": "cloud.ply"})";
  const auto folder = ReadDatasetFolder(root_);
  ASSERT_OK(folder);
  EXPECT_THAT(NamesOf(*folder), ElementsAre("cloud.ply", "images/a.jpg", "transforms.json"));
}

TEST_F(DatasetFolderTest, TakesMasksAmongThePhotographsAndInOtherLetters) {
  for (const char* name : {"images/a.jpg", "images/a_mask.png", "Keep/b.png"}) Put(name);
  std::ofstream(root_ / "transforms.json")
      << R"({"frames": [{"file_path": "images/a.jpg", "mask_path": "images/a_mask.png"},
                        {"file_path": "images/b.jpg", "mask_path": "keep/B.png"}]})";
  const auto folder = ReadDatasetFolder(root_);
  ASSERT_OK(folder);
  EXPECT_THAT(NamesOf(*folder),
              ElementsAre("Keep/b.png", "images/a.jpg", "images/a_mask.png", "transforms.json"));
  EXPECT_EQ(folder->files[0].kind, v1::FILE_KIND_MASK);
  EXPECT_EQ(folder->files[1].kind, v1::FILE_KIND_IMAGE);
  EXPECT_EQ(folder->files[2].kind, v1::FILE_KIND_MASK);
}

TEST_F(DatasetFolderTest, FindsFoldersInOtherLettersAndOneInside) {
  Put("unpacked/garden/Images/a.jpg");
  Put("unpacked/garden/Sparse/0/cameras.bin");
  Put("unpacked/.DS_Store");
  const auto folder = ReadDatasetFolder(root_);
  ASSERT_OK(folder);
  EXPECT_THAT(NamesOf(*folder), ElementsAre("images/a.jpg", "sparse/0/cameras.bin"));
}

TEST_F(DatasetFolderTest, SaysWhereItSawPhotographs) {
  Put("readme.txt");
  Put("day 1/raw/a.jpg");
  EXPECT_STATUS(ReadDatasetFolder(root_), absl::StatusCode::kInvalidArgument,
                "there are some in day 1/raw/: name that folder, or call it images/");
}

TEST_F(DatasetFolderTest, LeavesOutPointsWithoutBytes) {
  Put("images/a.jpg");
  Put("sparse/0/images.txt");
  std::ofstream(root_ / "sparse/0/points3D.txt").flush();
  const auto folder = ReadDatasetFolder(root_);
  ASSERT_OK(folder);
  EXPECT_THAT(NamesOf(*folder), ElementsAre("images/a.jpg", "sparse/0/images.txt"));
  std::ofstream(root_ / "transforms.json") << R"({"ply_file_path": "cloud.ply"})";
  std::ofstream(root_ / "cloud.ply").flush();
  const auto named = ReadDatasetFolder(root_);
  ASSERT_OK(named);
  EXPECT_THAT(named->left_out, ElementsAre("cloud.ply", "sparse/0/points3D.txt"));
}

TEST_F(DatasetFolderTest, RefusesNamesThatAreNotUtf8) {
  Put("images/caf\xe9.jpg");
  EXPECT_STATUS(ReadDatasetFolder(root_), absl::StatusCode::kInvalidArgument,
                "images/caf\\xe9.jpg\" is not UTF-8; rename the file");
}

}  // namespace
}  // namespace pepeseg::client
