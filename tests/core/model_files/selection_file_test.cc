#include <gtest/gtest.h>

#include "core/base/digest.h"
#include "core/base/file_io.h"
#include "core/model_files/model_file.h"
#include "tests/testing/status_testing.h"
#include "tests/testing/temp_folder.h"

namespace pepeseg {
namespace {

using absl::StatusCode::kDataLoss;

GaussianSet EveryThirdOf(int count) {
  GaussianSet set;
  for (int i = 0; i < count; ++i) set.member.push_back(i % 3 == 0 ? 1 : 0);
  return set;
}

TEST(SelectionFile, RoundTrips) {
  const testing::TempFolder folder;
  for (const int count : {0, 1, 7, 8, 9, 1000}) {
    const GaussianSet set = EveryThirdOf(count);
    ASSERT_OK(WriteSelectionFile(folder / "s", set));
    ASSERT_OK_AND_ASSIGN(const GaussianSet read, ReadSelectionFile(folder / "s", "s"));
    EXPECT_EQ(read.member, set.member) << count;
  }
}

TEST(SelectionFile, HasTheDocumentedBytes) {
  const testing::TempFolder folder;
  ASSERT_OK(WriteSelectionFile(folder / "s", EveryThirdOf(10)));
  ASSERT_OK_AND_ASSIGN(const std::string bytes, ReadFile(folder / "s", "s", 1 << 20));
  const std::string body("PPSGSELE\1\0\0\0\0\0\0\0\12\0\0\0\0\0\0\0\x49\2", 26);
  EXPECT_EQ(bytes, body + Sha256Hex(body));
}

TEST(SelectionFile, RejectsAnyFlippedBit) {
  const testing::TempFolder folder;
  ASSERT_OK(WriteSelectionFile(folder / "s", EveryThirdOf(40)));
  ASSERT_OK_AND_ASSIGN(const std::string good, ReadFile(folder / "s", "s", 1 << 20));
  for (size_t i = 0; i < good.size(); ++i) {
    std::string bytes = good;
    bytes[i] = static_cast<char>(bytes[i] ^ 1 << (i % 8));
    ASSERT_OK(WriteFileAtomically(folder / "s", bytes));
    EXPECT_STATUS(ReadSelectionFile(folder / "s", "shelf/3"), kDataLoss, "shelf/3");
  }
}

TEST(SelectionFile, RejectsMissingAndTruncatedFiles) {
  const testing::TempFolder folder;
  EXPECT_STATUS(ReadSelectionFile(folder / "s", "shelf/3"), kDataLoss, "shelf/3");
  ASSERT_OK(WriteSelectionFile(folder / "s", EveryThirdOf(40)));
  ASSERT_OK_AND_ASSIGN(const std::string good, ReadFile(folder / "s", "s", 1 << 20));
  for (const size_t size : {size_t{0}, size_t{8}, size_t{72}, good.size() - 1}) {
    ASSERT_OK(WriteFileAtomically(folder / "s", good.substr(0, size)));
    EXPECT_STATUS(ReadSelectionFile(folder / "s", "shelf/3"), kDataLoss, "shelf/3");
  }
}

// A file with a valid checksum may still have an invalid count.
TEST(SelectionFile, RejectsOtherVersionsAndInvalidCounts) {
  const testing::TempFolder folder;
  ASSERT_OK(WriteSelectionFile(folder / "s", EveryThirdOf(40)));
  ASSERT_OK_AND_ASSIGN(const std::string good, ReadFile(folder / "s", "s", 1 << 20));
  const auto expect_lost = [&](size_t at, char value, const std::string& why) {
    std::string body = good.substr(0, good.size() - 64);
    body[at] = value;
    ASSERT_OK(WriteFileAtomically(folder / "s", body + Sha256Hex(body)));
    EXPECT_STATUS(ReadSelectionFile(folder / "s", "s"), kDataLoss, why);
  };
  expect_lost(8, 2, "version 2");
  expect_lost(16, 41, "declares 41 Gaussians, which 5 bytes do not hold");
  expect_lost(23, 127, "declares");
}

}  // namespace
}  // namespace pepeseg
