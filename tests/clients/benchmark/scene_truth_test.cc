#include "clients/benchmark/scene_truth.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>

#include "tests/clients/benchmark/label_me_file.h"
#include "tests/testing/status_testing.h"
#include "tests/testing/temp_folder.h"

namespace pepeseg::client::cli {
namespace {

namespace fs = std::filesystem;
using ::testing::IsEmpty;
using testing::WriteLabelMe;

void WriteLabelImage(const fs::path& path) {
  fs::create_directories(path.parent_path());
  ASSERT_OK(WritePng(path, GreyPicture{2, 1, {3, 0}}));
}

TEST(FindTruth, ReadsTheLevelsInTheOrderOfTheList) {
  const testing::TempFolder folder;
  fs::create_directories(folder.path() / "gt");
  std::ofstream(folder.path() / "gt/labels.json") << R"({"part": ["-", "leg"], "object": [null]})";
  const auto levels = FindTruth(folder.path());
  ASSERT_OK(levels);
  ASSERT_EQ(levels->size(), 2u);
  EXPECT_EQ((*levels)[0].name, "part");
  EXPECT_EQ((*levels)[0].entities.at(1), "leg");
  EXPECT_EQ((*levels)[1].folder, folder.path() / "gt/object");
  EXPECT_TRUE((*levels)[1].entities.empty());
}

TEST(FindTruth, FallsBackToTheFolderOfLabelsOrToNothing) {
  const testing::TempFolder folder;
  EXPECT_THAT(*FindTruth(folder.path()), IsEmpty());
  fs::create_directories(folder.path() / "labels");
  const auto levels = FindTruth(folder.path());
  ASSERT_OK(levels);
  ASSERT_EQ(levels->size(), 1u);
  EXPECT_EQ((*levels)[0].name, "labels");
  fs::create_directories(folder.path() / "gt");
  std::ofstream(folder.path() / "gt/labels.json") << "[1]";
  EXPECT_EQ(FindTruth(folder.path()).status().code(), absl::StatusCode::kInvalidArgument);
}

TEST(FindTruth, ReadsOutlinesWhereThereAreNoLabelImages) {
  const testing::TempFolder folder;
  WriteLabelMe(folder.path() / "images/a.json");
  std::ofstream(folder.path() / "images/camera.json") << "{}";
  for (const char* better : {"images/a.json", "annotations/all/a.json", "labels/a.json"}) {
    WriteLabelMe(folder.path() / better);
    const auto levels = FindTruth(folder.path());
    ASSERT_OK(levels);
    ASSERT_EQ(levels->size(), 1u);
    EXPECT_EQ((*levels)[0].name, "labels");
    ASSERT_EQ((*levels)[0].outlines.size(), 1u);
    EXPECT_EQ((*levels)[0].outlines[0].file, folder.path() / better);
  }
  std::ofstream(folder.path() / "labels/b.json") << "{}";
  EXPECT_EQ(FindTruth(folder.path()).status().code(), absl::StatusCode::kInvalidArgument);
  WriteLabelImage(folder.path() / "labels/a.png");
  const auto images = FindTruth(folder.path());
  ASSERT_OK(images);
  EXPECT_THAT((*images)[0].outlines, IsEmpty());
}

// Returns the names of the photographs that have outlines at a path with one level.
std::vector<std::string> OutlinedAt(const fs::path& path) {
  const auto levels = FindTruthAt(path);
  EXPECT_OK(levels);
  if (!levels.ok() || levels->size() != 1) return {"not one level"};
  std::vector<std::string> names;
  for (const OutlinedPhotograph& photograph : (*levels)[0].outlines) {
    names.push_back(photograph.name);
  }
  return names;
}

TEST(FindTruthAt, ReadsASceneAsFindTruthDoes) {
  const testing::TempFolder folder;
  fs::create_directories(folder.path() / "images");
  WriteLabelMe(folder.path() / "masks/c.json");
  const auto none = FindTruthAt(folder.path());
  ASSERT_OK(none);
  EXPECT_THAT(*none, IsEmpty()) << "a scene has no truth in other folders";
  WriteLabelMe(folder.path() / "images/b.json");
  EXPECT_THAT(OutlinedAt(folder.path()), ::testing::ElementsAre("b"));
  WriteLabelMe(folder.path() / "annotations/a.json");
  EXPECT_THAT(OutlinedAt(folder.path()), ::testing::ElementsAre("a"));
}

TEST(FindTruthAt, ReadsTheFolderOrTheFileItself) {
  const testing::TempFolder folder;
  WriteLabelMe(folder.path() / "outlined/left/a.json");
  for (const char* path : {"outlined", "outlined/", "outlined/../outlined/."}) {
    EXPECT_THAT(OutlinedAt(folder.path() / path), ::testing::ElementsAre("left/a")) << path;
  }
  EXPECT_THAT(OutlinedAt(folder.path() / "outlined/left/a.json"), ::testing::ElementsAre("a"));
  WriteLabelImage(folder.path() / "outlined/b.png");
  EXPECT_THAT(OutlinedAt(folder.path() / "outlined"), IsEmpty()) << "it has a label image";
}

TEST(FindTruthAt, LeavesOutOtherFilesNextToPhotographsOnly) {
  const testing::TempFolder folder;
  for (const char* name : {"images", "outlined"}) {
    WriteLabelMe(folder.path() / name / "a.json");
    std::ofstream(folder.path() / name / "camera.json") << "{}";
  }
  for (const char* path : {"images", "images/", "images/./"}) {
    EXPECT_THAT(OutlinedAt(folder.path() / path), ::testing::ElementsAre("a")) << path;
  }
  for (const char* path : {"outlined", "images/camera.json"}) {
    EXPECT_TRUE(absl::IsInvalidArgument(FindTruthAt(folder.path() / path).status())) << path;
  }
}

}  // namespace
}  // namespace pepeseg::client::cli
