#include "server/rpc/blob_store.h"

#include <gtest/gtest.h>

#include <fstream>
#include <sstream>

#include "server/layout.h"
#include "tests/server/jobs/scratch_folder.h"

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

TEST(Sha256, MatchesThePublishedVectors) {
  Sha256 empty;
  EXPECT_EQ(empty.Finish(), "e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855");
  Sha256 parts;
  parts.Update("a");
  parts.Update("bc");
  EXPECT_EQ(parts.Finish(), kAbc);
}

TEST(BlobStore, KeepsABlobAsAWhole) {
  const ScratchFolder data;
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
  const ScratchFolder data;
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
  const ScratchFolder data;
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
  const ScratchFolder data;
  fs::create_directories(IncomingFolder(data.path()));
  std::ofstream(IncomingFolder(data.path()) / "0.part") << "half";
  const auto store = BlobStore::Open(data.path());
  ASSERT_TRUE(store.ok());
  EXPECT_EQ(CountFiles(data.path()), 0);
}

}  // namespace
}  // namespace pepeseg
