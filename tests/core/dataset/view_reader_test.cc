#include "core/dataset/view_reader.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <atomic>
#include <vector>

#include "absl/strings/str_cat.h"
#include "core/dataset/import.h"
#include "tests/testing/status_testing.h"

namespace pepeseg {
namespace {

TEST(NumReadersTest, BoundsWhatIsDecodedAtOnce) {
  EXPECT_EQ(NumReaders(1'000'000, 16), 16);
  EXPECT_EQ(NumReaders(12'000'000, 16), 10);
  EXPECT_EQ(NumReaders(64'000'000, 16), 2);
  EXPECT_EQ(NumReaders(500'000'000, 16), 1);
  EXPECT_EQ(NumReaders(12'000'000, 2), 2);
  EXPECT_GE(NumReaders(0, 0), 1);
}

TEST(ReadEachTest, ReadsEachOnce) {
  std::vector<std::atomic<int>> reads(100);
  EXPECT_OK(ReadEach(reads.size(), 4, [&](size_t i, int reader) {
    EXPECT_GE(reader, 0);
    EXPECT_LT(reader, 4);
    ++reads[i];
    return absl::OkStatus();
  }));
  for (const std::atomic<int>& read : reads) EXPECT_EQ(read, 1);
  EXPECT_OK(ReadEach(0, 4, [](size_t, int) { return absl::InternalError("called"); }));
}

// Whichever thread fails first, a person reads of the same file.
TEST(ReadEachTest, ReturnsTheFirstError) {
  for (int repeat = 0; repeat < 50; ++repeat) {
    const absl::Status status = ReadEach(100, 4, [](size_t i, int) {
      return i % 10 == 7 ? absl::InvalidArgumentError(absl::StrCat("file ", i)) : absl::OkStatus();
    });
    EXPECT_STATUS(status, absl::StatusCode::kInvalidArgument, "file 7");
  }
}

TEST(ImportCaptureOnThreads, GivesTheSameCapture) {
  ASSERT_OK_AND_ASSIGN(const auto files, ListDataset(PEPESEG_TEST_DATA "/apc_shelf"));
  ASSERT_OK_AND_ASSIGN(const Capture one, ImportCapture(files, {}, /*num_threads=*/1));
  ASSERT_OK_AND_ASSIGN(const Capture four, ImportCapture(files, {}, /*num_threads=*/4));
  ASSERT_EQ(one.views.size(), four.views.size());
  for (size_t i = 0; i < one.views.size(); ++i) {
    const View &a = one.views[i], &b = four.views[i];
    EXPECT_EQ(a.name, b.name);
    EXPECT_EQ(a.held_out, b.held_out) << a.name;
    EXPECT_EQ(a.camera, b.camera) << a.name;
    EXPECT_EQ(*a.photograph, *b.photograph) << a.name;
    EXPECT_EQ(a.photo.pixels, b.photo.pixels) << a.name;
    EXPECT_EQ(a.ignore, b.ignore) << a.name;
    EXPECT_EQ(a.masks.pixel_cell, b.masks.pixel_cell) << a.name;
    EXPECT_EQ(a.masks.cell_bits, b.masks.cell_bits) << a.name;
  }
}

}  // namespace
}  // namespace pepeseg
