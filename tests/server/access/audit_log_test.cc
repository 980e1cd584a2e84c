#include "server/access/audit_log.h"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <sys/stat.h>

#include <fstream>
#include <nlohmann/json.hpp>
#include <string>
#include <thread>
#include <vector>

#include "tests/testing/status_testing.h"
#include "tests/testing/temp_folder.h"

namespace pepeseg {
namespace {

std::vector<nlohmann::json> ReadLines(const std::filesystem::path& path) {
  std::vector<nlohmann::json> lines;
  std::ifstream file(path);
  for (std::string line; std::getline(file, line);) lines.push_back(nlohmann::json::parse(line));
  return lines;
}

AuditEntry EntryOf(const std::string& method) {
  return {"0123456789abcdef", "lab", "ipv4:127.0.0.1:9", method, {"scenes/a"}, "OK", ""};
}

TEST(AuditLog, WritesOneObjectPerLineForItsOwnerOnly) {
  const testing::TempFolder folder;
  const auto path = folder / "audit.log";
  {
    ASSERT_OK_AND_ASSIGN(const auto log, AuditLog::Open(path, {}));
    log->Write(EntryOf("Method"));
    AuditEntry odd = EntryOf("\"\n\xff");
    odd.resources = {std::string(5000, 'x')};
    odd.reason = "NOT_YOURS";
    log->Write(odd);
  }
  const auto reopened = AuditLog::Open(path, {});
  (*reopened)->Write(EntryOf("Later"));
  const auto lines = ReadLines(path);
  ASSERT_EQ(lines.size(), 3u);
  EXPECT_EQ(lines[0]["key"], "0123456789abcdef");
  EXPECT_EQ(lines[0]["project"], "lab");
  EXPECT_EQ(lines[0]["method"], "Method");
  EXPECT_EQ(lines[0]["resources"], nlohmann::json({"scenes/a"}));
  EXPECT_EQ(lines[0]["outcome"], "OK");
  EXPECT_FALSE(lines[0].contains("reason"));
  EXPECT_EQ(lines[1]["resources"][0].get<std::string>().size(), 256u);
  EXPECT_EQ(lines[1]["reason"], "NOT_YOURS");
  EXPECT_EQ(lines[2]["method"], "Later");
  struct stat status {};
  ASSERT_EQ(stat(path.c_str(), &status), 0);
  EXPECT_EQ(status.st_mode & 0777, 0600u);
}

TEST(RefusalLog, LeavesOutAndCountsLinesBeyondTheRate) {
  const testing::TempFolder folder;
  const auto path = folder / "refused.log";
  const absl::Time start = absl::FromUnixSeconds(1'800'000'000);
  {
    ASSERT_OK_AND_ASSIGN(const auto log,
                         RefusalLog::Open(path, {/*lines_per_second=*/2,
                                                 /*burst=*/5,
                                                 /*summary_interval=*/absl::Seconds(10),
                                                 {}}));
    // 25 lines a second for 20 s: the burst and 2 lines a second are written.
    for (int i = 0; i < 500; ++i) {
      log->Write(EntryOf("Method"), start + i * absl::Milliseconds(40));
    }
  }
  int num_written = 0, num_counted = 0, num_summaries = 0;
  for (const auto& line : ReadLines(path)) {
    num_written += line.contains("method") ? 1 : 0;
    num_summaries += line.contains("left_out") ? 1 : 0;
    num_counted += line.value("left_out", 0);
  }
  EXPECT_GE(num_written, 5 + 38);
  EXPECT_LE(num_written, 5 + 42);
  EXPECT_EQ(num_written + num_counted, 500);
  EXPECT_GE(num_summaries, 2);
  EXPECT_LE(num_summaries, 4);
}

TEST(AuditLog, RotatesBySizeAndKeepsTheNewest) {
  const testing::TempFolder folder;
  const auto path = folder / "audit.log";
  const auto log = AuditLog::Open(path, {1000, 2});
  for (int i = 0; i < 100; ++i) (*log)->Write(EntryOf(std::to_string(i)));
  const auto newest = ReadLines(path);
  ASSERT_FALSE(newest.empty());
  EXPECT_EQ(newest.back()["method"], "99");
  EXPECT_LT(std::filesystem::file_size(path), 1300u);
  const auto older = ReadLines(folder / "audit.log.1");
  EXPECT_EQ(std::stoi(older.back()["method"].get<std::string>()) + 1,
            std::stoi(newest.front()["method"].get<std::string>()));
  EXPECT_TRUE(std::filesystem::exists(folder / "audit.log.2"));
  EXPECT_FALSE(std::filesystem::exists(folder / "audit.log.3"));
}

TEST(AuditLog, LosesNoLineWhenTwoProcessesWriteAndRotate) {
  const testing::TempFolder folder;
  const auto path = folder / "audit.log";
  const auto write = [&] {
    const auto log = AuditLog::Open(path, {5000, 100});
    for (int i = 0; i < 500; ++i) (*log)->Write(EntryOf("Method"));
  };
  std::thread one(write), two(write);
  one.join();
  two.join();
  size_t lines = 0;
  for (const auto& entry : std::filesystem::directory_iterator(folder.path())) {
    lines += ReadLines(entry.path()).size();
  }
  EXPECT_EQ(lines, 1000u);
}

TEST(AuditLog, ReopensItsFileAfterItWasRemoved) {
  const testing::TempFolder folder;
  const auto path = folder / "audit.log";
  const auto log = AuditLog::Open(path, {});
  (*log)->Write(EntryOf("first"));
  std::filesystem::rename(path, folder / "taken");
  (*log)->Write(EntryOf("second"));
  ASSERT_EQ(ReadLines(path).size(), 1u);
  EXPECT_EQ(ReadLines(path)[0]["method"], "second");
  EXPECT_TRUE(absl::IsNotFound(AuditLog::Open(folder / "no" / "audit.log", {}).status()));
}

}  // namespace
}  // namespace pepeseg
