#include <gmock/gmock.h>
#include <unistd.h>

#include <atomic>
#include <csignal>
#include <fstream>

#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"
#include "server/worker_protocol/job_folder.h"
#include "tests/server/jobs/supervisor_fixture.h"
#include "tests/testing/eventually.h"
#include "tests/testing/status_testing.h"
#include "tests/testing/time_limit.h"

namespace pepeseg {
namespace {

using ::testing::HasSubstr;

TEST_F(SupervisorTest, CommitsTheModelOfAJobThatSucceeds) {
  const std::string job = Submit("succeed");
  const JobRecord end = WaitForEnd(job);
  EXPECT_EQ(end.state, JobState::kSucceeded);
  const auto model = store_->models().GetLiveModel(end.scene);
  ASSERT_OK(model);
  EXPECT_EQ(model->number, end.model);
  EXPECT_EQ(model->folder, "jobs/" + job + "/attempt-1");
  EXPECT_EQ(model->metrics, R"({"psnr":20.5})");
  EXPECT_EQ(model->num_gaussians, 7);
  EXPECT_TRUE(std::filesystem::exists(folder_.path() / model->folder / "gaussians.ply"));
}

TEST_F(SupervisorTest, LogsAllEventsOfAJob) {
  const std::string job = Submit("succeed");
  WaitForEnd(job);
  const auto events = EventsOf(job);
  ASSERT_EQ(events.size(), 6u);  // RUNNING, stage, three steps, SUCCEEDED
  for (size_t i = 0; i < events.size(); ++i) {
    EXPECT_EQ(events[i].sequence(), static_cast<int64_t>(i) + 1);
  }
  EXPECT_EQ(events[0].state_changed().state(), v1::JOB_STATE_RUNNING);
  EXPECT_EQ(events[1].stage_started().stage(), v1::JOB_STAGE_RECONSTRUCT);
  EXPECT_EQ(events[4].progress().step(), 3);
  EXPECT_EQ(events[5].state_changed().model(), "scenes/s1/models/1");
  // The supervisor reads the log after it has written the last event.
  absl::StatusOr<Supervisor::Newest> newest;
  EXPECT_TRUE(testing::Eventually([&] {
    newest = supervisor_->FindNewest(job);
    return newest.ok() && newest->sequence == 6;
  }));
  EXPECT_EQ(newest->progress->step(), 3);
}

// The server reads regular files of a worker, and nothing else.
class TakenOverWorker : public SupervisorTest {
 protected:
  TakenOverWorker() { std::ofstream(folder_ / "victim") << "kept"; }
  void ExpectVictimKept() {
    std::ifstream file(folder_ / "victim");
    EXPECT_EQ(std::string((std::istreambuf_iterator<char>(file)), {}), "kept");
  }
};

TEST_F(TakenOverWorker, CannotMakeTheServerFollowLinks) {
  const std::string job = Submit("plant links");
  EXPECT_EQ(WaitForEnd(job).state, JobState::kFailed);
  const auto events = EventsOf(job);
  ASSERT_FALSE(events.empty());
  EXPECT_EQ(events.back().state_changed().state(), v1::JOB_STATE_FAILED);
  ExpectVictimKept();
}

TEST_F(TakenOverWorker, CannotSubmitAModelWithALink) {
  const JobRecord end = WaitForEnd(Submit("model with a link"));
  EXPECT_EQ(end.state, JobState::kFailed);
  EXPECT_THAT(end.error_message, HasSubstr("not taken"));
  EXPECT_FALSE(store_->models().GetLiveModel(end.scene).ok());
  ExpectVictimKept();
}

TEST_F(TakenOverWorker, CannotWriteControlCharactersOrPathsToClients) {
  for (const char* act : {"curse", "crash with a curse"}) {
    const JobRecord end = WaitForEnd(Submit(act));
    EXPECT_EQ(end.state, JobState::kFailed);
    EXPECT_LE(end.error_message.size(), 2048u);
    EXPECT_THAT(end.error_message, HasSubstr("?[2J place"));
    EXPECT_THAT(end.error_message, ::testing::Not(HasSubstr("/srv")));
  }
}

TEST_F(SupervisorTest, NotifiesAWatchOfTheEnd) {
  const std::string job = Submit("hang");
  WaitForStage(job);
  std::atomic<int> num_calls = 0;
  std::atomic<int> num_others = 0;
  const auto watch = supervisor_->AddWatch(job, [&] { ++num_calls; });
  const auto other = supervisor_->AddWatch("j99", [&] { ++num_others; });
  ASSERT_OK(supervisor_->Cancel(job));
  EventsOf(job);
  EXPECT_TRUE(testing::Eventually([&] { return num_calls > 0; }));
  EXPECT_EQ(num_others, 0);
}

TEST_F(SupervisorTest, FailsWithTheWorkersReason) {
  const JobRecord end = WaitForEnd(Submit("fail"));
  EXPECT_EQ(end.state, JobState::kFailed);
  EXPECT_EQ(end.error_code, static_cast<int>(absl::StatusCode::kInvalidArgument));
  EXPECT_EQ(end.error_message, "images/bad.jpg: it is not a photograph");
  const auto events = EventsOf(end.id);
  ASSERT_FALSE(events.empty());
  const v1::Error& error = events.back().state_changed().error();
  EXPECT_EQ(error.message(), end.error_message);
  EXPECT_EQ(error.reason(), absl::StatusCodeToString(static_cast<absl::StatusCode>(error.code())));
}

TEST_F(SupervisorTest, FailsACrashedJobAndRunsTheNext) {
  const std::string crash = Submit("crash");
  const std::string next = Submit("succeed");
  const JobRecord end = WaitForEnd(crash);
  EXPECT_EQ(end.state, JobState::kFailed);
  EXPECT_THAT(end.error_message, HasSubstr("signal 6"));
  EXPECT_THAT(end.error_message, HasSubstr("stage 'reconstruct' at step 3 of 10"));
  EXPECT_THAT(end.error_message, HasSubstr("the fake worker writes to its log"));
  EXPECT_EQ(WaitForEnd(next).state, JobState::kSucceeded);
}

TEST_F(SupervisorTest, TreatsAnExitWithoutAResultAsACrash) {
  EXPECT_THAT(WaitForEnd(Submit("exit42")).error_message, HasSubstr("exited with code 42"));
  const JobRecord lie = WaitForEnd(Submit("lie"));
  EXPECT_EQ(lie.state, JobState::kFailed);
  EXPECT_THAT(lie.error_message, HasSubstr("exited with code 0"));
}

// Returns the worker's process: the child of this one whose command line has the job's folder.
pid_t FindWorker(const std::string& folder) {
  for (const auto& entry : std::filesystem::directory_iterator("/proc")) {
    std::ifstream file(entry.path() / "cmdline");
    const std::string words((std::istreambuf_iterator<char>(file)), {});
    if (words.find("--job=" + folder) != std::string::npos) {
      return std::stoi(entry.path().filename());
    }
  }
  return 0;
}

// Three crashes without progress are the limit.
TEST_F(SupervisorTest, FailsAJobWhoseWorkerIsKilledRepeatedlyAndRunsTheNext) {
  const std::string job = Submit("hang");
  const std::string next = Submit("succeed");
  for (int64_t fence = 1; fence <= 3; ++fence) {
    WaitFor(job, [&](const JobRecord& row) { return row.fence == fence && !row.stage.empty(); });
    const pid_t worker = FindWorker((folder_.path() / "jobs" / job).string());
    ASSERT_GT(worker, 0);
    ASSERT_EQ(kill(worker, SIGKILL), 0);
  }
  const JobRecord end = WaitForEnd(job);
  EXPECT_EQ(end.state, JobState::kFailed);
  EXPECT_THAT(end.error_message, HasSubstr("signal 9"));
  EXPECT_EQ(WaitForEnd(next).state, JobState::kSucceeded);
}

TEST_F(SupervisorTest, CancelsAQueuedJobAtOnce) {
  const std::string running = Submit("hang");
  const std::string queued = Submit("succeed");
  WaitForStage(running);
  EXPECT_EQ(supervisor_->Cancel(queued)->state, JobState::kCancelled);
  const auto events = EventsOf(queued);
  ASSERT_EQ(events.size(), 1u);
  EXPECT_EQ(events[0].state_changed().state(), v1::JOB_STATE_CANCELLED);
  EXPECT_EQ(store_->jobs().GetJob(running)->state, JobState::kRunning);
}

TEST_F(SupervisorTest, CancelsARunningJobWithinASecond) {
  const std::string job = Submit("hang");
  WaitForStage(job);
  const absl::Time start = absl::Now();
  EXPECT_EQ(supervisor_->Cancel(job)->state, JobState::kRunning);
  const JobRecord end = WaitForEnd(job);
  EXPECT_LT(absl::Now() - start, testing::TimeLimit(absl::Seconds(1)));
  EXPECT_EQ(end.state, JobState::kCancelled);
  EXPECT_EQ(supervisor_->Cancel(job)->state, JobState::kCancelled);
}

TEST_F(SupervisorTest, KillsAWorkerThatIgnoresTheCancel) {
  const std::string job = Submit("deaf");
  WaitForStage(job);
  ASSERT_OK(supervisor_->Cancel(job));
  EXPECT_EQ(WaitForEnd(job).state, JobState::kCancelled);
}

TEST_F(SupervisorTest, RunsAJobAgainWhoseWorkerWasTerminatedByOthers) {
  const JobRecord end = WaitForEnd(Submit("be terminated once"));
  EXPECT_EQ(end.state, JobState::kSucceeded);
  EXPECT_EQ(end.fence, 2);
}

TEST_F(SupervisorTest, RequeuesRunningJobsOnStop) {
  const std::string job = Submit("hang once");
  const std::string waiting = Submit("succeed");
  WaitForStage(job);
  supervisor_->Stop(absl::Now() + absl::Seconds(5));
  EXPECT_EQ(store_->jobs().GetJob(job)->state, JobState::kQueued);
  EXPECT_EQ(store_->jobs().GetJob(waiting)->state, JobState::kQueued);
  Restart();
  const JobRecord end = WaitForEnd(job);
  EXPECT_EQ(end.state, JobState::kSucceeded);
  EXPECT_EQ(end.fence, 2);
  EXPECT_EQ(WaitForEnd(waiting).state, JobState::kSucceeded);
}

TEST_F(SupervisorTest, ClaimsNoJobsAfterAStop) {
  StopClaims();
  const std::string job = Submit("succeed");
  absl::SleepFor(absl::Milliseconds(200));
  EXPECT_EQ(store_->jobs().GetJob(job)->state, JobState::kQueued);
}

// A server that is killed leaves its job RUNNING in the store.
TEST_F(SupervisorTest, RunsTheJobOfAKilledServerAgain) {
  StopClaims();
  const std::string job = Submit("succeed");
  ASSERT_TRUE((*store_->queue().ClaimJob("cpu")).has_value());
  Restart();
  const JobRecord end = WaitForEnd(job);
  EXPECT_EQ(end.state, JobState::kSucceeded);
  EXPECT_EQ(end.fence, 2);
}

TEST_F(SupervisorTest, FailsAJobDuringWhichServersKeepEnding) {
  StopClaims();
  const std::string job = Submit("succeed");
  for (int fence = 1; fence < 100; ++fence) {
    ASSERT_TRUE((*store_->queue().ClaimJob("cpu")).has_value());
    ASSERT_OK(store_->queue().RequeueJob(job, fence, {AttemptEnd::kServerEnded, false, {}}));
  }
  ASSERT_TRUE((*store_->queue().ClaimJob("cpu")).has_value());
  Restart();  // ends the hundredth attempt
  const JobRecord end = WaitForEnd(job);
  EXPECT_EQ(end.state, JobState::kFailed);
  EXPECT_THAT(end.error_message, HasSubstr("server ended during each of 100"));
}

// Three servers end during one attempt each, and then the worker crashes once.
TEST_F(SupervisorTest, DoesNotCountEndsOfTheServerAsCrashes) {
  StopClaims();
  const std::string job = Submit("crash at 4");
  for (int i = 0; i < 3; ++i) {
    ASSERT_TRUE((*store_->queue().ClaimJob("cpu")).has_value());
    ASSERT_OK(store_->queue().RequeueJob(job, i + 1,
                                         {AttemptEnd::kServerEnded, false, absl::ZeroDuration()}));
  }
  Restart();
  const JobRecord end = WaitForEnd(job);
  EXPECT_EQ(end.state, JobState::kSucceeded) << end.error_message;
  EXPECT_EQ(end.fence, 5);
}

TEST_F(SupervisorTest, PausesLongerAfterEachCrashWithoutDelayingOtherJobs) {
  options_.launch.crash_pauses = {absl::Milliseconds(300), absl::Milliseconds(900), absl::Hours(1)};
  Restart();
  const absl::Time start = absl::Now();
  const std::string crash = Submit("crash");
  WaitFor(crash, [](const JobRecord& row) { return row.crashes == 2; });
  const JobRecord paused = *store_->jobs().GetJob(crash);
  EXPECT_EQ(paused.state, JobState::kQueued);
  EXPECT_EQ(paused.fence, 2);
  EXPECT_GE(paused.not_before - start, absl::Milliseconds(1200));
  const std::string next = Submit("succeed");
  EXPECT_EQ(WaitForEnd(next).state, JobState::kSucceeded);
  const JobRecord end = WaitForEnd(crash);
  EXPECT_EQ(end.state, JobState::kFailed);
  EXPECT_EQ(end.fence, 3);
  EXPECT_GE(absl::Now() - start, absl::Milliseconds(1200));
  bool reported = false;
  for (const v1::JobEvent& event : EventsOf(crash)) {
    reported |= event.warning().message().find("it is tried again in 1 s") != std::string::npos;
  }
  EXPECT_TRUE(reported);
}

TEST_F(SupervisorTest, RestartsACrashedWorker) {
  const std::string job = Submit("crash once");
  const JobRecord end = WaitForEnd(job);
  EXPECT_EQ(end.state, JobState::kSucceeded);
  EXPECT_EQ(end.fence, 2);
  bool warned = false;
  for (const v1::JobEvent& event : EventsOf(job)) {
    warned |= event.warning().message().find("was killed by signal 6") != std::string::npos;
  }
  EXPECT_TRUE(warned);
}

// Three crashes after progress; three without would be the limit.
TEST_F(SupervisorTest, DoesNotCountACrashAfterProgress) {
  const JobRecord end = WaitForEnd(Submit("save and crash three times"));
  EXPECT_EQ(end.state, JobState::kSucceeded);
  EXPECT_EQ(end.fence, 4);
}

TEST_F(SupervisorTest, KillsASuspendedWorkerAndRestartsIt) {
  const std::string job = Submit("stop once");
  const JobRecord end = WaitForEnd(job);
  EXPECT_EQ(end.state, JobState::kSucceeded);
  EXPECT_EQ(end.fence, 2);
  EXPECT_THAT(EventsOf(job)[5].warning().message(), HasSubstr("gave no heartbeat"));
}

TEST(Supervisor, RefusesToStartWithoutItsWorker) {
  const testing::TempFolder folder;
  const auto store = Store::Open("sqlite:" + (folder.path() / "store.db").string()).value();
  SupervisorOptions options;
  options.data_folder = folder.path();
  options.worker = folder.path() / "nobody";
  EXPECT_EQ(Supervisor::Start(*store, options).status().code(), absl::StatusCode::kNotFound);
}

TEST(HolderName, NamesALivingProcess) {
  const std::string name = HolderName();
  EXPECT_EQ(name, HolderName());
  EXPECT_FALSE(IsKnownGone(name));
  EXPECT_TRUE(IsKnownGone(name + "1"));  // an earlier process had this id
  EXPECT_FALSE(IsKnownGone("another-boot/pid:[1]/1/2"));
  EXPECT_FALSE(IsKnownGone(""));
  EXPECT_FALSE(IsKnownGone("server"));
}

}  // namespace
}  // namespace pepeseg
