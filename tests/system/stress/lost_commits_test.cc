// A server loses its connection to PostgreSQL at a COMMIT, so that it cannot know whether it was
// applied. Each COMMIT of a scene's life in turn with PEPESEG_STRESS=full, otherwise every 23rd.
#include <gtest/gtest.h>

#include <fstream>
#include <iostream>
#include <map>
#include <nlohmann/json.hpp>
#include <string>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "absl/time/clock.h"
#include "server/store/layout.h"
#include "server/store/soci.h"
#include "tests/server/pepesegd_process.h"
#include "tests/server/store/commit_cutter.h"
#include "tests/server/store/test_database.h"
#include "tests/system/stress/life_of_a_scene.h"
#include "tests/testing/full_stress.h"
#include "tests/testing/temp_folder.h"

namespace pepeseg {
namespace {

using testing::CommitCutter;
using testing::PepesegdProcess;

struct CommitReport {
  int64_t num_commits = 0, num_tried = 0, num_cut = 0;
  int64_t num_reported = 0;  // lives that got an error, and continued
  absl::Duration slowest;
  std::vector<std::string> broken;
};

class LostCommits : public ::testing::Test {
 protected:
  // Runs a life on a new database and cuts its `number`th COMMIT. Returns what is wrong with the
  // result.
  std::string Live(int64_t number, CommitCutter::Cut cut, CommitReport& report) {
    cutter_.Arm(0, cut);  // it is still armed if the life made fewer COMMITs
    const std::string url = database_.NewDatabase(cutter_.host());
    const testing::TempFolder folder;
    PepesegdProcess server(
        folder / "data",
        testing::PepesegdOptions{{"--database=" + url}, {}, PEPESEG_MODEL_WORKER, "", false});
    LifeOfAScene life("first");
    cutter_.Arm(number, cut);
    const absl::Time start = absl::Now();
    absl::Status status = life.Run(server.channel());
    if (!status.ok()) ++report.num_reported;
    for (int i = 0; absl::IsUnavailable(status) && i < 10; ++i) {
      absl::SleepFor(absl::Milliseconds(20));
      status = life.Run(server.channel());
    }
    if (status.ok()) status = life.Check(server.channel());
    if (absl::IsUnavailable(status))
      status = life.Check(server.channel());  // it makes COMMITs, too
    report.slowest = std::max(report.slowest, absl::Now() - start);
    report.num_commits = cutter_.num_commits();
    if (cutter_.has_cut()) ++report.num_cut;
    if (!server.alive()) return "the server has ended: " + server.Log();
    if (!status.ok()) return absl::StrCat(status.ToString(), "\n", server.Log());
    return FindDoubles(url, folder / "data") + FindUnrecorded(folder / "data");
  }

  // The audit log has the creation of the scene, and a second line of each call that it has: the
  // server decides what became of a call, also of one whose COMMIT was not answered.
  static std::string FindUnrecorded(const std::filesystem::path& data) {
    std::map<std::string, int> num_lines;  // by call
    bool created = false;
    std::ifstream file(AuditPath(data));
    for (std::string text; std::getline(file, text);) {
      const auto line = nlohmann::json::parse(text);
      if (line.contains("call")) ++num_lines[line["call"].get<std::string>()];
      created |= line["method"] == "pepeseg.v1.SceneService.CreateScene" &&
                 line["resources"] == nlohmann::json({"first"});
    }
    std::string wrong = created ? "" : "the creation of the scene is not in the audit log";
    for (const auto& [call, count] : num_lines) {
      if (count != 2) absl::StrAppend(&wrong, " ", count, " lines of call ", call);
    }
    return wrong;
  }

  // Each object of a life exists exactly once.
  static std::string FindDoubles(const std::string& url, const std::filesystem::path& data) {
    const std::map<std::string, int> wanted = {{"scenes", 1}, {"datasets", 1},   {"jobs", 1},
                                               {"models", 1}, {"selections", 2}, {"labels", 0}};
    soci::session sql(**PostgresqlBackend(), url.substr(std::string("postgresql:").size()));
    std::vector<std::string> wrong;
    for (const auto& [table, want] : wanted) {
      int count = 0;
      sql << "SELECT COUNT(*) FROM " << table, soci::into(count);
      if (count != want) wrong.push_back(absl::StrCat(count, " ", table));
    }
    int fence = 0;
    sql << "SELECT MAX(fence) FROM jobs", soci::into(fence);
    if (fence != 1) wrong.push_back(absl::StrCat(fence, " attempts"));
    // If the answer to the COMMIT of a file's record is lost, the file may be left without one. The
    // collector removes it after a day.
    const soci::rowset<std::string> files = (sql.prepare << "SELECT file FROM selections");
    for (const std::string& file : files) {
      if (!std::filesystem::exists(data / file)) wrong.push_back("no file " + file);
    }
    return absl::StrJoin(wrong, ", ");
  }

  CommitReport CutEach(CommitCutter::Cut cut) {
    CommitReport report;
    CommitReport calm;
    const std::string wrong = Live(0, cut, calm);
    EXPECT_EQ(wrong, "");
    const int64_t num_commits = calm.num_commits;
    for (int64_t k = 1; k <= num_commits; k += testing::FullStress() ? 1 : 23) {
      ++report.num_tried;
      const std::string found = Live(k, cut, report);
      if (!found.empty()) report.broken.push_back(absl::StrCat(k, ": ", found));
    }
    report.num_commits = num_commits;
    std::cout << num_commits << " commits, " << report.num_tried << " tried, " << report.num_cut
              << " cut, " << report.num_reported << " reported, slowest "
              << absl::FormatDuration(report.slowest) << "; broken: " << report.broken.size()
              << "\n"
              << absl::StrJoin(report.broken, "\n") << "\n";
    return report;
  }

  testing::PostgresqlServer database_;
  CommitCutter cutter_{database_.socket()};
};

TEST_F(LostCommits, AreHandledBeforeTheDatabaseGotThem) {
  const CommitReport report = CutEach(CommitCutter::Cut::kBefore);
  EXPECT_TRUE(report.broken.empty());
  EXPECT_GE(report.num_commits, 20);
  // A slow life has more COMMITs, which the server makes to look after its jobs.
  EXPECT_GE(report.num_cut, report.num_tried * 7 / 10);
}

TEST_F(LostCommits, AreHandledAfterTheDatabaseAppliedThem) {
  const CommitReport report = CutEach(CommitCutter::Cut::kAfter);
  EXPECT_TRUE(report.broken.empty());
  EXPECT_GE(report.num_cut, report.num_tried * 7 / 10);
}

}  // namespace
}  // namespace pepeseg
