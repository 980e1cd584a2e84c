#include <gmock/gmock.h>

#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "tests/server/store/store_fixture.h"
#include "tests/testing/status_testing.h"

namespace pepeseg {
namespace {

using ::testing::HasSubstr;

TEST_F(StoreTest, SealsOnlyCompleteDatasets) {
  MakeScene("a");
  ASSERT_OK_AND_ASSIGN(const auto made,
                       store_->datasets().CreateDataset(SceneOf(*store_, "a"), "r",
                                                        {{"images/1.jpg", 1, 10, "aa", true},
                                                         {"images/2.jpg", 1, 20, "bb", false}}));
  EXPECT_EQ(made.number, 1);
  EXPECT_EQ(made.num_files, 2);
  EXPECT_EQ(made.num_bytes, 30);
  EXPECT_STATUS(store_->datasets().SealDataset(SceneOf(*store_, "a"), 1),
                absl::StatusCode::kFailedPrecondition, "images/2.jpg");
  const UploadName upload{SceneOf(*store_, "a"), 1};
  EXPECT_EQ(store_->files().MarkFilesStored(upload, {{"images/3.jpg", 1, 20, "bb"}}).code(),
            absl::StatusCode::kNotFound);
  EXPECT_EQ(store_->files().MarkFilesStored(upload, {{"images/2.jpg", 1, 20, "cc"}}).code(),
            absl::StatusCode::kNotFound)
      << "of another upload of this name, which was deleted since";
  DatasetFileRecord second{"images/2.jpg", 1, 20, "bb"};
  second.header = HeaderState::kRead;
  second.width = 640;
  second.height = 480;
  ASSERT_OK(store_->files().MarkFilesStored(upload, {second}));
  const auto stored = store_->files().GetDatasetFile(SceneOf(*store_, "a"), 1, "images/2.jpg");
  EXPECT_TRUE(stored->stored);
  EXPECT_EQ(stored->header, HeaderState::kRead);
  EXPECT_EQ(stored->width, 640);
  EXPECT_EQ(stored->height, 480);
  ASSERT_OK_AND_ASSIGN(const auto sealed, store_->datasets().SealDataset(SceneOf(*store_, "a"), 1));
  EXPECT_EQ(sealed.state, DatasetState::kSealed);
  EXPECT_OK(store_->datasets().SealDataset(SceneOf(*store_, "a"), 1));
  EXPECT_EQ(store_->files().MarkFilesStored(upload, {second}).code(),
            absl::StatusCode::kFailedPrecondition);
}

// Passes more files than one SQL statement takes to every call that has a list of files.
TEST_F(StoreTest, StoresThousandsOfFiles) {
  constexpr int kFiles = 1000;
  MakeScene("a");
  std::vector<DatasetFileRecord> files;
  files.reserve(kFiles);
  for (int i = 0; i < kFiles; ++i) {
    files.push_back({absl::StrCat("images/", 1000 + i, ".jpg"), 1, 10 + i, absl::StrCat("d", i)});
  }
  ASSERT_OK(store_->datasets().CreateDataset(SceneOf(*store_, "a"), "", files));
  ASSERT_OK_AND_ASSIGN(auto listed, store_->files().ListDatasetFilesFrom(SceneOf(*store_, "a"), 1,
                                                                         "images/1500.jpg", 100));
  ASSERT_EQ(listed.size(), 100u);
  EXPECT_EQ(listed[0].path, "images/1500.jpg");
  EXPECT_EQ(listed[99].path, "images/1599.jpg");
  ASSERT_OK(store_->files().MarkFilesStored({SceneOf(*store_, "a"), 1}, listed));
  EXPECT_EQ(store_->files().ListBlobs(kDefaultProject)->size(), 100u);
  EXPECT_THAT(
      std::string(store_->datasets().SealDataset(SceneOf(*store_, "a"), 1).status().message()),
      HasSubstr("900 of 1000 files are not uploaded"));
  ASSERT_OK(store_->datasets().SealDataset(SceneOf(*store_, "a"), 1, files));
  for (DatasetFileRecord& file : files) {
    file.header = HeaderState::kRead;
    file.num_points = 2 * file.size;
  }
  ASSERT_OK(store_->files().SetFileHeaders(SceneOf(*store_, "a"), 1, files));
  ASSERT_OK_AND_ASSIGN(listed, store_->files().ListDatasetFiles(SceneOf(*store_, "a"), 1));
  ASSERT_EQ(listed.size(), size_t{kFiles});
  for (const DatasetFileRecord& file : listed) {
    EXPECT_TRUE(file.stored);
    EXPECT_EQ(file.num_points, 2 * file.size) << file.path;
  }
  ASSERT_OK(store_->files().ForgetBlobs(kDefaultProject, {"d0", "d999", "other"}));
  EXPECT_EQ(store_->files().ListBlobs(kDefaultProject)->size(), 998u);
}

TEST_F(StoreTest, CreatesOneDatasetForARepeatedRequest) {
  MakeScene("a");
  const std::vector<DatasetFileRecord> files = {{"x", 1, 10, "aa", false},
                                                {"y", 1, 10, "ab", false}};
  EXPECT_EQ(store_->datasets().CreateDataset(SceneOf(*store_, "a"), "r", files)->number, 1);
  EXPECT_EQ(
      store_->datasets().CreateDataset(SceneOf(*store_, "a"), "r", {files[1], files[0]})->number,
      1);
  EXPECT_EQ(
      store_->datasets().CreateDataset(SceneOf(*store_, "a"), "r", {files[0]}).status().code(),
      absl::StatusCode::kAlreadyExists);
  EXPECT_EQ(store_->datasets().CreateDataset(SceneOf(*store_, "a"), "", files)->number, 2);
  EXPECT_EQ(store_->datasets().CreateDataset(SceneOf(*store_, "b"), "", files).status().code(),
            absl::StatusCode::kNotFound);
}

TEST_F(StoreTest, ListsSealedDatasetsByNumber) {
  MakeScene("a");
  for (int i = 0; i < 4; ++i) {
    ASSERT_OK(
        store_->datasets().CreateDataset(SceneOf(*store_, "a"), "", {{"x", 1, 10, "aa", true}}));
  }
  for (const int64_t number : {4, 1, 2})
    ASSERT_OK(store_->datasets().SealDataset(SceneOf(*store_, "a"), number));
  const auto page = store_->datasets().ListDatasets(SceneOf(*store_, "a"), {2, ""});
  ASSERT_EQ(page->records.size(), 2u);
  EXPECT_EQ(page->records[1].number, 2);
  const auto rest =
      store_->datasets().ListDatasets(SceneOf(*store_, "a"), {2, page->next_page_token});
  ASSERT_EQ(rest->records.size(), 1u);
  EXPECT_EQ(rest->records[0].number, 4);
  EXPECT_EQ(rest->next_page_token, "");
}

TEST_F(StoreTest, MarksADigestInAllDatasetsOfItsProject) {
  ASSERT_OK(store_->scenes().CreateScene(NewScene("ours")));
  ASSERT_OK(store_->scenes().CreateScene(NewScene("theirs", "", "", "other")));
  for (const char* scene : {"ours", "theirs"}) {
    ASSERT_OK(store_->datasets().CreateDataset(SceneOf(*store_, scene), "",
                                               {{"a", 1, 3, "00", true}, {"b", 1, 3, "11", true}}));
    ASSERT_OK(store_->datasets().SealDataset(SceneOf(*store_, scene), 1));
  }
  const auto is_stored = [&](const std::string& scene, const std::string& path) {
    return store_->files().GetDatasetFile(SceneOf(*store_, scene), 1, path)->stored;
  };
  ASSERT_OK(store_->files().SetDigestsStored(kDefaultProject, {"00", "22"}, false));
  EXPECT_FALSE(is_stored("ours", "a"));
  EXPECT_TRUE(is_stored("ours", "b"));
  EXPECT_TRUE(is_stored("theirs", "a"));
  ASSERT_OK(store_->files().SetDigestsStored(kDefaultProject, {"00"}, true));
  EXPECT_TRUE(is_stored("ours", "a"));
}

TEST_F(StoreTest, FindsFilesOfAKind) {
  ASSERT_OK(store_->scenes().CreateScene(NewScene("a")));
  constexpr int kImage = 1, kMask = 3;
  const std::string digest(64, 'a');
  ASSERT_OK(store_->datasets().CreateDataset(SceneOf(*store_, "a"), "",
                                             {{"images/1.jpg", kImage, 5, digest}}));
  EXPECT_TRUE(*store_->files().HasFileOfKind(SceneOf(*store_, "a"), 1, kImage));
  EXPECT_FALSE(*store_->files().HasFileOfKind(SceneOf(*store_, "a"), 1, kMask));
  EXPECT_FALSE(*store_->files().HasFileOfKind(SceneOf(*store_, "a"), 2, kImage));
}

}  // namespace
}  // namespace pepeseg
