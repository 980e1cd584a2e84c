#include "server/data/blob_store.h"

#include <gtest/gtest.h>

#include <atomic>
#include <fstream>
#include <sstream>

#include "core/base/digest.h"
#include "tests/testing/status_testing.h"
#include "tests/testing/temp_folder.h"

namespace pepeseg {
namespace {

namespace fs = std::filesystem;

// echo -n abc | sha256sum
constexpr char kAbc[] = "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad";
constexpr int64_t kCommit = int64_t{32} << 20;

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

struct BlobStoreTest : ::testing::Test {
  BlobStoreTest() : store(*BlobStore::Open(data.path())) {}

  std::shared_ptr<BlobWriter> Begin(const std::string& sha256, int64_t size, int64_t offset = 0) {
    auto writer = store->Begin(upload, sha256, size);
    EXPECT_OK(writer);
    EXPECT_OK((*writer)->Start(offset));
    while (!(*writer)->ready()) EXPECT_OK((*writer)->Rehash());
    return *std::move(writer);
  }

  const testing::TempFolder data;
  const UploadName upload{{1, "lab", "shelf"}, 1};
  const BlobName abc{"lab", kAbc};
  std::unique_ptr<BlobStore> store;
};

TEST_F(BlobStoreTest, StoresAWholeBlob) {
  EXPECT_FALSE(store->Has(abc, 3));
  const auto writer = Begin(kAbc, 3);
  ASSERT_OK(writer->Append("ab"));
  EXPECT_FALSE(store->Has(abc, 3));
  ASSERT_OK(writer->Append("c"));
  ASSERT_OK(writer->Commit());
  EXPECT_TRUE(store->Has(abc, 3));
  EXPECT_FALSE(store->Has(abc, 4));
  EXPECT_FALSE(store->Has({"other", kAbc}, 3)) << "another project's";
  EXPECT_EQ(ReadFile(store->Path(abc)), "abc");
  EXPECT_EQ(CountFiles(data.path()), 1);
  EXPECT_EQ(*store->Begin(upload, kAbc, 3), nullptr) << "it is there";
}

TEST_F(BlobStoreTest, SetsADamagedBlobAsideUntilItIsUploadedAgain) {
  const std::atomic<bool> cancel = false;
  const auto bring = [&] {
    const auto writer = Begin(kAbc, 3);
    ASSERT_OK(writer->Append("abc"));
    ASSERT_OK(writer->Commit());
  };
  EXPECT_TRUE(absl::IsDataLoss(store->Verify(abc, cancel))) << "it was never there";
  bring();
  EXPECT_OK(store->Verify(abc, cancel));
  EXPECT_TRUE(store->Has(abc, 3));
  std::ofstream(store->Path(abc)) << "abd";
  EXPECT_TRUE(store->Has(abc, 3)) << "only the size is looked at";
  EXPECT_TRUE(absl::IsDataLoss(store->Verify(abc, cancel)));
  EXPECT_FALSE(store->Has(abc, 3));
  EXPECT_EQ(ReadFile(DamagedPath(data.path(), abc)), "abd");
  bring();
  EXPECT_OK(store->Verify(abc, cancel));
  EXPECT_EQ(ReadFile(store->Path(abc)), "abc");
  const std::atomic<bool> cancelled = true;
  EXPECT_TRUE(absl::IsCancelled(store->Verify(abc, cancelled)));
}

TEST_F(BlobStoreTest, RemovesBytesWithAnotherDigest) {
  {
    const auto writer = Begin(kAbc, 3);
    ASSERT_OK(writer->Append("abd"));
    EXPECT_TRUE(absl::IsDataLoss(writer->Commit()));
  }
  EXPECT_EQ(CountFiles(data.path()), 0);
  EXPECT_TRUE(absl::IsInvalidArgument(Begin(kAbc, 3)->Append("abcd")));
  EXPECT_FALSE(store->Has(abc, 3));
  EXPECT_EQ(CountFiles(data.path()), 0);
}

TEST_F(BlobStoreTest, ResumesWhereAWriterEnded) {
  {
    const auto writer = Begin(kAbc, 3);
    ASSERT_OK(writer->Append("ab"));
    EXPECT_TRUE(absl::IsInvalidArgument(writer->Commit()));
  }
  ASSERT_EQ(store->ListPartial(upload).size(), 1u);
  EXPECT_EQ(store->ListPartial(upload).at(kAbc), 2);
  EXPECT_TRUE(store->ListPartial({{1, "lab", "shelf"}, 2}).empty());
  store = *BlobStore::Open(data.path());  // files that others write stay
  const auto writer = Begin(kAbc, 3, 2);
  ASSERT_OK(writer->Append("c"));
  ASSERT_OK(writer->Commit());
  EXPECT_EQ(ReadFile(store->Path(abc)), "abc");
  EXPECT_EQ(CountFiles(data.path()), 1);
}

TEST_F(BlobStoreTest, RefusesOtherOffsets) {
  ASSERT_OK(Begin(kAbc, 3)->Append("ab"));
  for (const int64_t offset : {1, 3, -1}) {
    const auto writer = *store->Begin(upload, kAbc, 3);
    EXPECT_EQ(writer->committed(), 2);
    EXPECT_TRUE(absl::IsOutOfRange(writer->Start(offset))) << offset;
  }
  EXPECT_EQ(store->ListPartial(upload).at(kAbc), 2) << "it stays";
  const auto again = Begin(kAbc, 3, 0);
  EXPECT_TRUE(store->ListPartial(upload).empty());
  ASSERT_OK(again->Append("abc"));
  EXPECT_OK(again->Commit());
}

TEST_F(BlobStoreTest, AllowsOneWriterAtATimeAcrossServers) {
  const auto other = *BlobStore::Open(data.path());
  auto writer = Begin(kAbc, 3);
  EXPECT_TRUE(absl::IsAborted(store->Begin(upload, kAbc, 3).status()));
  EXPECT_TRUE(absl::IsAborted(other->Begin(upload, kAbc, 3).status()));
  EXPECT_OK(other->Begin({{1, "lab", "shelf"}, 2}, kAbc, 3).status()) << "another upload's";
  ASSERT_OK(writer->Append("abc"));
  ASSERT_OK(writer->Commit());
  EXPECT_EQ(*other->Begin(upload, kAbc, 3), nullptr);
}

TEST_F(BlobStoreTest, CommitsEvery32MiB) {
  const std::string bytes(2 * kCommit + 1000, 'x');
  const std::string digest = Sha256Hex(bytes);
  const auto writer = Begin(digest, static_cast<int64_t>(bytes.size()));
  for (size_t at = 0; at < bytes.size(); at += 1 << 20) {
    ASSERT_OK(writer->Append(std::string_view(bytes).substr(at, 1 << 20)));
    const int64_t written = std::min(at + (1 << 20), bytes.size());
    const auto partial = store->ListPartial(upload);
    const int64_t committed = partial.empty() ? 0 : partial.at(digest);
    EXPECT_EQ(committed, written / kCommit * kCommit) << written;
  }
  EXPECT_OK(writer->Commit());
  EXPECT_EQ(CountFiles(data.path()), 1);
}

// After a power cut the bytes past the last commit may be missing, or hold anything.
TEST_F(BlobStoreTest, CountsOnlyCommittedBytes) {
  ASSERT_OK(Begin(kAbc, 3)->Append("ab"));
  const fs::path partial = PartialFolderOf(data.path(), upload) / kAbc;
  std::ofstream(partial, std::ios::app) << "garbage";
  EXPECT_EQ(store->ListPartial(upload).at(kAbc), 2);
  auto writer = Begin(kAbc, 3, 2);
  ASSERT_OK(writer->Append("c"));
  EXPECT_OK(writer->Commit());
  fs::remove(store->Path(abc));
  ASSERT_OK(Begin(kAbc, 3)->Append("ab"));
  fs::resize_file(partial, 1);
  EXPECT_TRUE(store->ListPartial(upload).empty());
}

}  // namespace
}  // namespace pepeseg
