// Jobs on several devices, and previews that find none free.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/server/jobs/supervisor_fixture.h"

namespace pepeseg {
namespace {

using ::testing::HasSubstr;

class JobsOnDevices : public SupervisorTest {
 protected:
  // Starts the supervisor with logical CPU devices.
  void StartWith(int num_devices) {
    options_.devices.clear();
    for (int i = 0; i < num_devices; ++i) {
      options_.devices.push_back(
          {absl::StrCat("cpu:", i), absl::StrCat("cpu ", i, " (test)"), i + 1});
    }
    options_.launch.checkpoint_seconds = 1;
    Restart();
  }

  // Returns the text of the warnings in the job's events.
  std::string WarningsOf(const std::string& job) {
    std::string text;
    for (const v1::JobEvent& event : EventsOf(job)) text += event.warning().message();
    return text;
  }

  JobSpec SpecOf(const std::string& job) {
    const JobFolder folder(folder_.path() / "jobs" / job);
    return folder.ReadSpec(folder.NewestFence()).value_or(JobSpec());
  }
};

TEST_F(JobsOnDevices, RunsAJobOnEachAndLetsTheThirdWait) {
  StartWith(2);
  const std::string first = Submit("hang");
  const std::string second = Submit("hang");
  const std::string third = Submit("succeed");
  WaitForStage(first);
  WaitForStage(second);
  const auto device = [&](const std::string& job) { return store_->jobs().GetJob(job)->device; };
  EXPECT_EQ(device(first), "cpu 0 (test)");
  EXPECT_EQ(device(second), "cpu 1 (test)");
  EXPECT_EQ(SpecOf(first).device, "cpu:0");
  EXPECT_EQ(SpecOf(second).device, "cpu:1");
  EXPECT_EQ(SpecOf(second).num_threads, 2);
  absl::SleepFor(absl::Milliseconds(200));
  EXPECT_EQ(store_->jobs().GetJob(third)->state, JobState::kQueued);
  const std::vector<DeviceUse::Use> uses = supervisor_->device_use();
  EXPECT_EQ(uses[0].job, first);
  EXPECT_EQ(uses[1].job, second);
  EXPECT_GE(uses[1].job_time, absl::Milliseconds(100));
  ASSERT_OK(supervisor_->Cancel(second));
  EXPECT_EQ(WaitForEnd(third).device, "cpu 1 (test)");
  EXPECT_EQ(store_->jobs().GetJob(first)->state, JobState::kRunning);
  EXPECT_TRUE(testing::Eventually([&] { return supervisor_->device_use()[1].job.empty(); }));
}

TEST_F(JobsOnDevices, StartsThePreviewBeforeOlderJobs) {
  StartWith(1);
  const std::string runs = Submit("hang");
  WaitForStage(runs);
  const std::string older = Submit("succeed");
  const std::string preview = Submit("work a while", /*preview=*/true);
  ASSERT_OK(supervisor_->Cancel(runs));
  WaitForStage(preview);
  EXPECT_EQ(store_->jobs().GetJob(older)->state, JobState::kQueued);
  EXPECT_LE(WaitForEnd(preview).end_time, WaitForEnd(older).start_time);
}

// Nothing else ends the first job: it hangs until it is stopped.
TEST_F(JobsOnDevices, PutsAJobBackForAPreview) {
  StartWith(1);
  const std::string victim = Submit("save and hang 1");
  const std::string older = Submit("succeed");
  WaitForStage(victim);
  const std::string preview = Submit("work a while", /*preview=*/true);
  EXPECT_EQ(WaitForEnd(preview).state, JobState::kSucceeded);
  const JobRecord end = WaitForEnd(victim);
  EXPECT_EQ(end.state, JobState::kSucceeded);
  EXPECT_EQ(end.fence, 2);
  EXPECT_EQ(end.put_backs, 1);
  EXPECT_EQ(end.crashes, 0);
  EXPECT_THAT(WarningsOf(victim), HasSubstr("put back into the queue, because a preview waits"));
  // The job that was put back starts right after the preview.
  const JobRecord before = WaitForEnd(preview), after = WaitForEnd(older);
  EXPECT_LE(before.end_time, end.start_time);
  EXPECT_LE(end.end_time, after.start_time);
  EXPECT_EQ(WarningsOf(preview), "");
}

TEST_F(JobsOnDevices, PutsNoJobBackForOthersThanPreviews) {
  StartWith(1);
  const std::string runs = Submit("save and hang 1");
  WaitForStage(runs);
  const std::string other = Submit("succeed");
  absl::SleepFor(absl::Milliseconds(2500));
  EXPECT_EQ(store_->jobs().GetJob(runs)->fence, 1);
  EXPECT_EQ(store_->jobs().GetJob(other)->state, JobState::kQueued);
}

TEST_F(JobsOnDevices, PutsNoPreviewAndNoJobWithoutACheckpointBack) {
  StartWith(2);
  const std::string preview = Submit("save and hang 1", /*preview=*/true);
  const std::string unsaved = Submit("hang");
  WaitForStage(preview);
  WaitForStage(unsaved);
  const std::string waits = Submit("succeed", /*preview=*/true);
  absl::SleepFor(absl::Milliseconds(2500));
  EXPECT_EQ(store_->jobs().GetJob(preview)->fence, 1);
  EXPECT_EQ(store_->jobs().GetJob(unsaved)->fence, 1);
  EXPECT_EQ(store_->jobs().GetJob(waits)->state, JobState::kQueued);
}

// A job runs twice as long before it is put back once more.
TEST_F(JobsOnDevices, PutsAJobBackLessAndLessOften) {
  StartWith(1);
  const std::string victim = Submit("save and hang 2");
  WaitForStage(victim);
  WaitForEnd(Submit("succeed", /*preview=*/true));
  WaitFor(victim, [](const JobRecord& row) { return row.fence == 2; });
  const absl::Time again = store_->jobs().GetJob(victim)->start_time;
  const JobRecord second = WaitForEnd(Submit("succeed", /*preview=*/true));
  EXPECT_GE(second.start_time - again, absl::Seconds(2));
  const JobRecord end = WaitForEnd(victim);
  EXPECT_EQ(end.state, JobState::kSucceeded);
  EXPECT_EQ(end.put_backs, 2);
}

TEST_F(JobsOnDevices, CancelsAJobThatIsOnItsWayBack) {
  StartWith(1);
  const std::string victim = Submit("save and hang 9");
  WaitForStage(victim);
  const std::string preview = Submit("hang once", /*preview=*/true);
  WaitForStage(preview);
  ASSERT_OK(supervisor_->Cancel(victim));
  EXPECT_EQ(WaitForEnd(victim).state, JobState::kCancelled);
  ASSERT_OK(supervisor_->Cancel(preview));
  EXPECT_EQ(WaitForEnd(preview).state, JobState::kCancelled);
}

}  // namespace
}  // namespace pepeseg
