#include "server/rpc/blob_store.h"

#include <gtest/gtest.h>

#include <fstream>
#include <sstream>

#include "server/layout.h"
#include "tests/testing/temp_folder.h"

namespace pepeseg {
namespace {

namespace fs = std::filesystem;

// echo -n abc | sha256sum
constexpr char kAbc[] = "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad";

int64_t CountFiles(const fs::path& folder) {
  int64_t count = 0;
  for (const auto& entry : fs::recursive_directory_iterator(folder))
    count += entry.is_regular_file();
  return count;
}

std::string ReadFile(const fs::path& path) {
  std::ostringstream bytes;
  bytes << std::ifstream(path, std::ios::binary).rdbuf();
  return bytes.str();
}

TEST(BlobStore, KeepsABlobAsAWhole) {
  const testing::TempFolder data;
  const auto store = BlobStore::Open(data.path());
  ASSERT_TRUE(store.ok()) << store.status();
  EXPECT_FALSE((*store)->Has(kAbc, 3));
  const auto writer = (*store)->Begin(kAbc, 3);
  ASSERT_TRUE(writer.ok()) << writer.status();
  ASSERT_TRUE((*writer)->Append("ab").ok());
  EXPECT_FALSE((*store)->Has(kAbc, 3));
  ASSERT_TRUE((*writer)->Append("c").ok());
  ASSERT_TRUE((*writer)->Commit().ok());
  EXPECT_TRUE((*store)->Has(kAbc, 3));
  EXPECT_FALSE((*store)->Has(kAbc, 4));
  EXPECT_EQ(ReadFile((*store)->Path(kAbc)), "abc");
  EXPECT_EQ(CountFiles(data.path()), 1);
}

TEST(BlobStore, WrongBytesLeaveNothing) {
  const testing::TempFolder data;
  const auto store = BlobStore::Open(data.path());
  ASSERT_TRUE(store.ok());
  {
    auto writer = *(*store)->Begin(kAbc, 3);
    ASSERT_TRUE(writer->Append("abd").ok());
    EXPECT_TRUE(absl::IsDataLoss(writer->Commit()));
  }
  {
    auto writer = *(*store)->Begin(kAbc, 3);
    EXPECT_TRUE(absl::IsInvalidArgument(writer->Append("abcd")));
  }
  {
    auto writer = *(*store)->Begin(kAbc, 3);
    ASSERT_TRUE(writer->Append("ab").ok());
    EXPECT_TRUE(absl::IsInvalidArgument(writer->Commit()));
  }
  EXPECT_FALSE((*store)->Has(kAbc, 3));
  EXPECT_EQ(CountFiles(data.path()), 0);
}

TEST(BlobStore, TwoWritersOfOneBlobAgree) {
  const testing::TempFolder data;
  const auto store = BlobStore::Open(data.path());
  auto one = *(*store)->Begin(kAbc, 3);
  auto two = *(*store)->Begin(kAbc, 3);
  ASSERT_TRUE(one->Append("abc").ok());
  ASSERT_TRUE(two->Append("abc").ok());
  EXPECT_TRUE(one->Commit().ok());
  EXPECT_TRUE(two->Commit().ok());
  EXPECT_EQ(ReadFile((*store)->Path(kAbc)), "abc");
  EXPECT_EQ(CountFiles(data.path()), 1);
}

TEST(BlobStore, ClearsWhatACrashLeft) {
  const testing::TempFolder data;
  fs::create_directories(BlobPath(data.path(), kAbc).parent_path());
  std::ofstream(BlobPath(data.path(), kAbc)) << "abc";
  std::ofstream(BlobPath(data.path(), kAbc).string() + ".x8QbZ1") << "half";
  const auto store = BlobStore::Open(data.path());
  ASSERT_TRUE(store.ok());
  EXPECT_EQ(CountFiles(data.path()), 1);
  EXPECT_TRUE((*store)->Has(kAbc, 3));
}

}  // namespace
}  // namespace pepeseg
