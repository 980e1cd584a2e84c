#include "core/base/file_io.h"

#include <gtest/gtest.h>

#include <iterator>

#include "tests/testing/status_testing.h"
#include "tests/testing/temp_folder.h"

namespace pepeseg {
namespace {

using testing::TempFolder;

auto NumFiles(const TempFolder& folder) {
  return std::distance(std::filesystem::directory_iterator(folder.path()), {});
}

TEST(AtomicFile, AppearsCompleteOnCommit) {
  const TempFolder folder;
  ASSERT_OK_AND_ASSIGN(AtomicFile file, AtomicFile::Create(folder / "a"));
  EXPECT_OK(file.Append(std::string_view("one ")));
  EXPECT_OK(file.Append(std::string_view("two")));
  EXPECT_FALSE(std::filesystem::exists(folder / "a"));
  EXPECT_OK(file.Commit());
  ASSERT_OK_AND_ASSIGN(const std::string bytes, ReadFile(folder / "a", "a", 100));
  EXPECT_EQ(bytes, "one two");
  EXPECT_EQ(NumFiles(folder), 1);
}

TEST(AtomicFile, KeepsTheOldFileWithoutCommit) {
  const TempFolder folder;
  ASSERT_OK(WriteFileAtomically(folder / "a", "old"));
  {
    ASSERT_OK_AND_ASSIGN(AtomicFile file, AtomicFile::Create(folder / "a"));
    AtomicFile moved = std::move(file);
    EXPECT_OK(moved.Append(std::string_view("new")));
    EXPECT_EQ(NumFiles(folder), 2);
  }
  EXPECT_EQ(NumFiles(folder), 1);
  ASSERT_OK_AND_ASSIGN(const std::string bytes, ReadFile(folder / "a", "a", 100));
  EXPECT_EQ(bytes, "old");
}

TEST(AtomicFile, NamesThePathThatCannotBeCreated) {
  const TempFolder folder;
  EXPECT_STATUS(WriteFileAtomically(folder / "no" / "a", "x"), absl::StatusCode::kNotFound,
                "/no/a");
}

TEST(ReadFile, RejectsLargeAndMissingFilesAndFolders) {
  const TempFolder folder;
  ASSERT_OK(WriteFileAtomically(folder / "a", "12345"));
  EXPECT_STATUS(ReadFile(folder / "a", "a.bin", 4), absl::StatusCode::kInvalidArgument,
                "a.bin: 5 bytes, the limit is 4");
  EXPECT_STATUS(ReadFile(folder / "b", "b.bin", 4), absl::StatusCode::kNotFound, "b.bin");
  EXPECT_STATUS(ReadFile(folder.path(), "c.bin", 4), absl::StatusCode::kInvalidArgument,
                "not a regular file");
}

}  // namespace
}  // namespace pepeseg
