// The runs of io_fault_lives.h: a sample of the calls, or all of them with PEPESEG_STRESS=full.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <iostream>
#include <set>

#include "absl/strings/str_cat.h"
#include "tests/server/service_client.h"
#include "tests/system/stress/io_fault_lives.h"
#include "tests/testing/full_stress.h"
#include "tests/testing/status_testing.h"

namespace pepeseg {
namespace {

using testing::FullStress;

std::set<std::string> CodesOf(const FaultReport& report) {
  std::set<std::string> codes;
  for (const auto& [code, count] : report.codes) codes.insert(code);
  return codes;
}

std::vector<testing::ClientFile> TinyFiles(int num_files) {
  std::vector<testing::ClientFile> files;
  files.reserve(num_files);
  for (int i = 0; i < num_files; ++i) {
    files.push_back({absl::StrCat("images/", 10'000 + i, ".jpg"), v1::FILE_KIND_IMAGE,
                     absl::StrCat("tiny file ", i)});
  }
  return files;
}

int64_t NumSyncs(const std::map<std::string, int64_t>& calls) {
  return calls.at("fsync") + calls.at("fdatasync") + calls.at("syncfs");
}

// A sync takes milliseconds. One per file would take half a minute for these files on a slow disk.
TEST(DurableCalls, AreSharedByTheFilesOfAnUpload) {
  constexpr int kFiles = 1000;
  const auto files = TinyFiles(kFiles);
  const auto upload = [&](const std::shared_ptr<grpc::Channel>& channel) {
    testing::ServiceClient client(channel);
    ASSERT_OK(client.CreateScene("shelf"));
    ASSERT_OK(client.Upload("shelf", files));
  };
  const auto calls = CountDurableCalls(upload);
  // Some of the calls are the server's probes of its disk.
  EXPECT_GE(calls.at("rename"), kFiles + 1) << "each file, and the manifest";
  EXPECT_LT(NumSyncs(calls), kFiles / 5);
  const auto twice = CountDurableCalls([&](const std::shared_ptr<grpc::Channel>& channel) {
    upload(channel);
    testing::ServiceClient client(channel);
    ASSERT_OK_AND_ASSIGN(const v1::Upload again, client.CreateUpload("shelf", files));
    EXPECT_EQ(again.missing_files_size(), 0);
    ASSERT_OK(client.SealUpload(again.name()));
  });
  EXPECT_GE(twice.at("rename"), kFiles + 2);
  EXPECT_LT(NumSyncs(twice), NumSyncs(calls) + 40) << "of what is there nothing is synced";
  std::cout << NumSyncs(calls) << " syncs for " << kFiles << " files, " << NumSyncs(twice)
            << " with the same again\n";
}

TEST(KillServer, AtAnyDurableCallLeavesACleanState) {
  const FaultReport report = KillAtEveryDurableCall(FullStress() ? 1 : 17);
  std::cout << report.ToString() << "\n";
  EXPECT_TRUE(report.broken.empty());
  EXPECT_TRUE(report.unclean.empty());
  EXPECT_GE(report.num_points, 30);
  // Threads race, so the order of the calls varies a little.
  EXPECT_GE(report.num_killed, report.num_tried * 9 / 10);
}

TEST(FullDisk, FailsWithAReasonAndRecoversWhenThereIsSpace) {
  const FaultReport report = FillDiskAtEveryCall(FullStress() ? 1 : 29);
  std::cout << report.ToString() << "\n";
  EXPECT_TRUE(report.broken.empty());
  EXPECT_TRUE(report.unclean.empty());
  EXPECT_THAT(CodesOf(report),
              ::testing::IsSubsetOf(
                  {"OK", "RESOURCE_EXHAUSTED", "UNAVAILABLE for a full disk", "did not start"}));
  EXPECT_TRUE(report.codes.contains("RESOURCE_EXHAUSTED"));
  // Few calls write the state of a job: a sample may have none of them.
  if (FullStress()) {
    EXPECT_TRUE(report.codes.contains("UNAVAILABLE for a full disk"));
  }
}

// Each read of a server fails in turn.
TEST(ReadError, IsReportedAndDamagesNothing) {
  const FaultReport report = FailEveryRead(FullStress() ? 1 : 37);
  std::cout << report.ToString() << "\n";
  EXPECT_TRUE(report.broken.empty());
  EXPECT_TRUE(report.unclean.empty());
  EXPECT_GE(report.num_points, 30);
  EXPECT_THAT(CodesOf(report),
              ::testing::IsSubsetOf({"OK", "INTERNAL", "DATA_LOSS", "did not start"}));
}

}  // namespace
}  // namespace pepeseg
