// Starts and ends of jobs that cannot be written for a while. The supervisor tries them again with
// pauses, and loses nothing.
#include <fcntl.h>
#include <gmock/gmock.h>
#include <spdlog/sinks/ostream_sink.h>
#include <spdlog/spdlog.h>
#include <sys/resource.h>
#include <unistd.h>

#include <atomic>
#include <fstream>
#include <sstream>
#include <string_view>

#include "server/store/soci.h"
#include "tests/server/jobs/supervisor_fixture.h"
#include "tests/testing/eventually.h"
#include "tests/testing/status_testing.h"
#include "tests/testing/time_limit.h"

namespace pepeseg {
namespace {

using ::testing::HasSubstr;

struct UnwrittenStates : SupervisorTest {
  UnwrittenStates() : outer(spdlog::default_logger()) {
    const auto sink = std::make_shared<spdlog::sinks::ostream_sink_mt>(log);
    spdlog::set_default_logger(std::make_shared<spdlog::logger>("test", sink));
  }
  ~UnwrittenStates() override {
    supervisor_.reset();
    spdlog::set_default_logger(outer);
  }

  // A second connection to the supervisor's database.
  void Change(const std::string& statement) const {
    constexpr std::string_view kScheme = "sqlite:";
    soci::session sql(soci::sqlite3, "dbname=" + database_.substr(kScheme.size()) + " timeout=10");
    sql << statement;
  }
  absl::Status WaitForObstacle(const std::string& job, bool queued) const {
    absl::Status obstacle;
    EXPECT_TRUE(testing::Eventually([&] {
      obstacle = supervisor_->FindObstacle(job, queued);
      return !obstacle.ok();
    }));
    return obstacle;
  }
  // Ends the supervisor, so that the log is complete.
  int CountLines(const std::string& words) {
    supervisor_.reset();
    spdlog::default_logger()->flush();
    const std::string text = log.str();
    int count = 0;
    for (size_t at = text.find(words); at != std::string::npos; at = text.find(words, at + 1)) {
      ++count;
    }
    return count;
  }

  std::ostringstream log;
  std::shared_ptr<spdlog::logger> outer;
};

TEST_F(UnwrittenStates, ReportsAnEndAndWritesItLater) {
  Change("ALTER TABLE models RENAME TO no_models");
  const absl::Time start = absl::Now();
  std::atomic<int> num_calls = 0;
  const std::string job = Submit("succeed");
  const auto watch = supervisor_->AddWatch(job, [&] { ++num_calls; });
  const absl::Status obstacle = WaitForObstacle(job, /*queued=*/false);
  EXPECT_THAT(std::string(obstacle.message()), HasSubstr("models"));
  EXPECT_LT(absl::Now() - start, testing::TimeLimit(absl::Seconds(5)));
  EXPECT_GE(num_calls, 1);
  EXPECT_OK(supervisor_->FindObstacle("j99", /*queued=*/true)) << "of this job only";
  EXPECT_EQ(store_->jobs().GetJob(job)->state, JobState::kRunning);
  absl::SleepFor(start + absl::Seconds(5) - absl::Now());
  Change("ALTER TABLE no_models RENAME TO models");
  EXPECT_EQ(WaitForEnd(job).state, JobState::kSucceeded);
  EXPECT_EQ(EventsOf(job).back().state_changed().state(), v1::JOB_STATE_SUCCEEDED);
  EXPECT_TRUE(
      testing::Eventually([&] { return supervisor_->FindObstacle(job, /*queued=*/false).ok(); }));
  // It is tried again after 1, 2 and 4 s.
  EXPECT_LE(CountLines("writing its end"), 4);
}

TEST_F(UnwrittenStates, ReportsAFailedClaimAndRepeatsIt) {
  Change(
      "CREATE TRIGGER full BEFORE UPDATE OF state ON jobs BEGIN SELECT RAISE(FAIL, 'full'); END");
  const std::string job = Submit("succeed");
  EXPECT_FALSE(WaitForObstacle(job, /*queued=*/true).ok());
  EXPECT_OK(supervisor_->FindObstacle(job, /*queued=*/false)) << "runs at another server";
  EXPECT_EQ(store_->jobs().GetJob(job)->state, JobState::kQueued);
  Change("DROP TRIGGER full");
  EXPECT_EQ(WaitForEnd(job).state, JobState::kSucceeded);
  EXPECT_OK(supervisor_->FindObstacle(job, /*queued=*/true));
  EXPECT_LE(CountLines("claiming a job"), 4);
}

TEST_F(UnwrittenStates, LosesNoModelWithoutDescriptors) {
  const std::string job = Submit("work a while");
  WaitForStage(job);
  rlimit all{};
  ASSERT_EQ(getrlimit(RLIMIT_NOFILE, &all), 0);
  const int next = open("/dev/null", O_RDONLY | O_CLOEXEC);
  ASSERT_GE(next, 0);
  close(next);
  const rlimit none = {static_cast<rlim_t>(next), all.rlim_max};
  ASSERT_EQ(setrlimit(RLIMIT_NOFILE, &none), 0);
  const absl::Status obstacle = WaitForObstacle(job, /*queued=*/false);
  ASSERT_EQ(setrlimit(RLIMIT_NOFILE, &all), 0);
  EXPECT_TRUE(absl::IsUnavailable(obstacle)) << obstacle;
  EXPECT_EQ(store_->jobs().GetJob(job)->state, JobState::kRunning);
  EXPECT_EQ(WaitForEnd(job).state, JobState::kSucceeded);
  EXPECT_EQ(store_->jobs().GetJob(job)->fence, 1);
  EXPECT_LE(CountLines("writing its end"), 3);
}

TEST_F(UnwrittenStates, NamesNoFolderOfTheServerInAFailedStart) {
  std::ofstream(folder_.path() / "jobs") << "in the way";
  const JobRecord job = WaitForEnd(Submit("succeed"));
  EXPECT_EQ(job.state, JobState::kFailed);
  EXPECT_THAT(job.error_message, HasSubstr("create"));
  EXPECT_THAT(job.error_message, ::testing::Not(HasSubstr(folder_.path().parent_path().string())));
}

}  // namespace
}  // namespace pepeseg
