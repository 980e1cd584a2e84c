#include "server/worker_protocol/snapshot_file.h"

#include <gtest/gtest.h>

#include <filesystem>

#include "core/base/file_io.h"
#include "core/model_files/checkpoint.h"
#include "tests/testing/status_testing.h"
#include "tests/testing/temp_folder.h"

namespace pepeseg {
namespace {

namespace fs = std::filesystem;

constexpr int64_t kMany = 1 << 20;

struct SnapshotFileTest : ::testing::Test {
  SnapshotFileTest() {
    EXPECT_OK(job.Make());
    written = {"j1", 2, 30, 100, {}};
    written.field.features.assign(64, 0.0f);
    written.field.features[3] = 1;
    written.field.confidence = {0.5f, 1.0f};
    written.field.scale_quantiles = {1, 2, 3};
    EXPECT_OK(WriteSnapshotFile(job.snapshot(2), written));
  }
  absl::StatusOr<SnapshotFile> Read(int64_t max_bytes = kMany) const {
    return ReadSnapshotFile(job, "j1", 2, max_bytes);
  }

  const testing::TempFolder folder;
  const JobFolder job{folder / "j1"};
  SnapshotFile written;
};

TEST_F(SnapshotFileTest, IsReadAsWritten) {
  ASSERT_OK_AND_ASSIGN(const SnapshotFile read, Read());
  EXPECT_EQ(read.job, "j1");
  EXPECT_EQ(read.fence, 2);
  EXPECT_EQ(read.step, 30);
  EXPECT_EQ(read.num_steps, 100);
  EXPECT_EQ(read.field.features, written.field.features);
  EXPECT_EQ(read.field.confidence, written.field.confidence);
  EXPECT_EQ(read.field.gate, written.field.gate);
  EXPECT_EQ(read.field.scale_quantiles, written.field.scale_quantiles);
}

TEST_F(SnapshotFileTest, HasAnotherStampWhenItIsReplaced) {
  EXPECT_FALSE(FindSnapshot(job, 1));
  const auto first = FindSnapshot(job, 2);
  ASSERT_TRUE(first);
  EXPECT_EQ(FindSnapshot(job, 2), first);
  written.field.scale_quantiles.push_back(4);
  ASSERT_OK(WriteSnapshotFile(job.snapshot(2), written));
  EXPECT_NE(FindSnapshot(job, 2), first);
}

TEST_F(SnapshotFileTest, IsRefusedIfItIsOfAnotherJobOrAttempt) {
  EXPECT_TRUE(absl::IsDataLoss(ReadSnapshotFile(job, "j2", 2, kMany).status()));
  fs::copy_file(job.snapshot(2), job.snapshot(3));
  EXPECT_TRUE(absl::IsDataLoss(ReadSnapshotFile(job, "j1", 3, kMany).status()));
}

TEST_F(SnapshotFileTest, IsRefusedIfItIsNoSnapshot) {
  const CheckpointHeader header = {"features", "j1/2", 30};
  ASSERT_OK(WriteCheckpoint(job.snapshot(2), header, {}));
  EXPECT_TRUE(absl::IsDataLoss(Read().status()));
  const CheckpointHeader empty = {"snapshot", "j1/2", 30};
  ASSERT_OK(WriteCheckpoint(job.snapshot(2), empty, {}));
  EXPECT_TRUE(absl::IsDataLoss(Read().status()));
  written.step = 101;
  ASSERT_OK(WriteSnapshotFile(job.snapshot(2), written));
  EXPECT_TRUE(absl::IsDataLoss(Read().status()));
}

TEST_F(SnapshotFileTest, IsRefusedIfAnyByteIsWrong) {
  const std::string bytes = ReadFile(job.snapshot(2), "snapshot", kMany).value();
  for (size_t at = 0; at < bytes.size(); at += 7) {
    std::string wrong = bytes;
    wrong[at] = static_cast<char>(wrong[at] ^ 1);
    ASSERT_OK(WriteFileAtomically(job.snapshot(2), wrong));
    ASSERT_TRUE(absl::IsDataLoss(Read().status())) << at;
  }
}

TEST_F(SnapshotFileTest, IsNotReadThroughALinkOrBeyondTheLimit) {
  EXPECT_TRUE(absl::IsFailedPrecondition(Read(100).status()));
  fs::rename(job.snapshot(2), folder / "elsewhere");
  fs::create_symlink(folder / "elsewhere", job.snapshot(2));
  EXPECT_FALSE(FindSnapshot(job, 2));
  EXPECT_FALSE(Read().ok());
}

TEST_F(SnapshotFileTest, HasGaussiansThatAreCopied) {
  const fs::path to = folder / "to";
  fs::create_directories(to);
  const SnapshotStamp stamp = {.fence = 2};
  EXPECT_TRUE(absl::IsNotFound(CopySnapshotGaussians(job, stamp, to, kMany)));
  const fs::path given = job.attempt(2) / "given";
  fs::create_directories(given / "below");
  ASSERT_OK(WriteFileAtomically(given / "model.json", "{}"));
  fs::create_symlink(job.snapshot(2), given / "link");
  EXPECT_TRUE(absl::IsFailedPrecondition(CopySnapshotGaussians(job, stamp, to, 1)));
  fs::remove(to / "model.json");
  ASSERT_OK(CopySnapshotGaussians(job, stamp, to, kMany));
  EXPECT_EQ(ReadFile(to / "model.json", "copy", kMany).value(), "{}");
  EXPECT_FALSE(fs::exists(to / "below"));
  EXPECT_FALSE(fs::exists(fs::symlink_status(to / "link")));
}

// The folder of attempt 2, in which a worker has written an early model.
struct EarlySnapshotTest : ::testing::Test {
  EarlySnapshotTest() {
    EXPECT_OK(job.Make());
    fs::create_directories(job.early(2));
    EXPECT_OK(WriteFileAtomically(job.early(2) / "model.json", "early"));
  }
  void Finish() const { EXPECT_OK(WriteFileAtomically(job.early(2) / "manifest.json", "{}")); }

  const testing::TempFolder folder;
  const JobFolder job{folder / "j1"};
};

TEST_F(EarlySnapshotTest, CountsOnceItsManifestIsThere) {
  EXPECT_FALSE(FindSnapshot(job, 2));
  Finish();
  const auto early = FindSnapshot(job, 2);
  ASSERT_TRUE(early);
  EXPECT_TRUE(early->is_early);
  EXPECT_FALSE(FindSnapshot(job, 1));
}

TEST_F(EarlySnapshotTest, GivesWayToAFile) {
  Finish();
  EXPECT_OK(WriteSnapshotFile(job.snapshot(2), {"j1", 2, 1, 100, {}}));
  const auto newest = FindSnapshot(job, 2);
  ASSERT_TRUE(newest);
  EXPECT_FALSE(newest->is_early);
}

TEST_F(EarlySnapshotTest, HasGaussiansOfItsOwn) {
  Finish();
  fs::create_directories(job.reconstruction(2));
  ASSERT_OK(WriteFileAtomically(job.reconstruction(2) / "model.json", "whole"));
  for (const bool is_early : {true, false}) {
    const fs::path to = folder / (is_early ? "early" : "whole");
    fs::create_directories(to);
    ASSERT_OK(CopySnapshotGaussians(job, {.fence = 2, .is_early = is_early}, to, kMany));
    EXPECT_EQ(ReadFile(to / "model.json", "copy", kMany).value(), is_early ? "early" : "whole");
  }
}

TEST_F(EarlySnapshotTest, IsNotFoundThroughALink) {
  Finish();
  fs::rename(job.early(2), folder / "elsewhere");
  fs::create_directory_symlink(folder / "elsewhere", job.early(2));
  EXPECT_FALSE(FindSnapshot(job, 2));
}

}  // namespace
}  // namespace pepeseg
