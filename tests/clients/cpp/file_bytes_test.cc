#include "clients/cpp/file_bytes.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>

#include "tests/testing/status_testing.h"

namespace pepeseg::client {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;

class FileBytes : public ::testing::Test {
 protected:
  FileBytes()
      : folder_(fs::path(::testing::TempDir()) / ("file_bytes_" + std::to_string(getpid()))) {
    fs::create_directories(folder_);
  }
  ~FileBytes() override { fs::remove_all(folder_); }

  fs::path folder_;
};

TEST_F(FileBytes, CreatesTheFoldersAboveAnOutput) {
  const fs::path path = folder_ / "a" / "b" / "x.ply";
  const std::string bytes(3'000'000, 'x');
  ASSERT_OK(WriteFile(path, bytes));
  const auto read = ReadFile(path);
  ASSERT_OK(read);
  EXPECT_EQ(*read, bytes);
  EXPECT_FALSE(fs::exists(folder_ / "a" / "b" / "x.ply.part"));
}

TEST_F(FileBytes, NamesTheFileAndTheErrorOfTheSystem) {
  const absl::Status missing = ReadFile(folder_ / "none.png").status();
  EXPECT_TRUE(absl::IsNotFound(missing));
  EXPECT_TRUE(IsLocalFileError(missing));
  EXPECT_THAT(std::string(missing.message()), HasSubstr("none.png: No such file or directory"));

  const absl::Status is_folder = ReadFile(folder_).status();
  EXPECT_TRUE(IsLocalFileError(is_folder));
  EXPECT_THAT(std::string(is_folder.message()), HasSubstr("Is a directory"));

  std::ofstream(folder_ / "file") << "x";
  const absl::Status below_file = WriteFile(folder_ / "file" / "x.ply", "x");
  EXPECT_TRUE(IsLocalFileError(below_file));
  EXPECT_THAT(std::string(below_file.message()), HasSubstr("file: "));

  const absl::Status onto_folder = WriteFile(folder_, "x");
  EXPECT_TRUE(IsLocalFileError(onto_folder));
  EXPECT_THAT(std::string(onto_folder.message()), HasSubstr("Is a directory"));
  EXPECT_FALSE(IsLocalFileError(absl::NotFoundError("scenes/shelf does not exist")));
}

TEST_F(FileBytes, RemovesAnOutputThatIsNotCommitted) {
  {
    auto file = OutputFile::Create(folder_ / "x.ply");
    ASSERT_OK(file);
    ASSERT_OK(file->Append("half"));
  }
  EXPECT_TRUE(fs::is_empty(folder_));
}

TEST(OutputFile, ReportsAFullDisk) {
  if (!fs::exists("/dev/full")) GTEST_SKIP() << "this system has no /dev/full";
  const fs::path link = fs::path(::testing::TempDir()) / "full.ply.part";
  fs::remove(link);
  fs::create_symlink("/dev/full", link);
  const absl::Status full = WriteFile(fs::path(::testing::TempDir()) / "full.ply", "x");
  EXPECT_TRUE(absl::IsResourceExhausted(full)) << full;
  EXPECT_THAT(std::string(full.message()), HasSubstr("full.ply: No space left on device"));
}

}  // namespace
}  // namespace pepeseg::client
