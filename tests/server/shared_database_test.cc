// Servers that share a PostgreSQL database and a data directory.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <csignal>
#include <fstream>
#include <set>

#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"
#include "server/store/store.h"
#include "tests/server/pepesegd_process.h"
#include "tests/server/service_client.h"
#include "tests/server/store/test_database.h"
#include "tests/testing/eventually.h"
#include "tests/testing/status_testing.h"
#include "tests/testing/temp_folder.h"
#include "tests/testing/time_limit.h"

namespace pepeseg {
namespace {

using testing::PepesegdProcess;
using testing::ServiceClient;

class SharedDatabaseTest : public ::testing::Test {
 protected:
  std::unique_ptr<PepesegdProcess> Serve(const std::string& name, int lease_seconds = 3) {
    return std::make_unique<PepesegdProcess>(
        folder_ / "data",
        testing::PepesegdOptions{
            {"--database=" + url_, absl::StrCat("--lease-seconds=", lease_seconds)},
            {},
            PEPESEG_FAKE_WORKER,
            name,
            false});
  }

  // Submits a job whose worker does what `act` says, and returns its name.
  std::string Train(ServiceClient& client, const std::string& act) {
    const std::string scene = absl::StrCat("s", ++num_scenes_);
    EXPECT_OK(client.CreateScene(scene));
    const auto dataset =
        client.Upload(scene, {{act, v1::FILE_KIND_IMAGE, absl::StrCat(act, scene)}});
    EXPECT_OK(dataset);
    const auto job = client.Train(scene, dataset.value_or(""), {});
    EXPECT_OK(job);
    return job.ok() ? job->name() : "";
  }

  static v1::Job WaitForState(ServiceClient& client, const std::string& job, v1::JobState state) {
    v1::Job found;
    EXPECT_TRUE(testing::Eventually([&] {
      found = client.GetJob(job).value_or(v1::Job());
      return found.state() == state;
    })) << job
        << " is not " << v1::JobState_Name(state);
    return found;
  }

  int64_t FenceOf(const std::string& job) {
    const auto store = Store::Open(url_);
    EXPECT_OK(store);
    return (*store)->jobs().GetJob(job.substr(5)).value_or(JobRecord()).fence;
  }

  testing::PostgresqlServer database_;
  const std::string url_ = database_.NewDatabase();
  const testing::TempFolder folder_;
  int num_scenes_ = 0;
};

// The suspended server wakes up after another has taken its job. Its worker ended long before.
TEST_F(SharedDatabaseTest, FinishesTheJobOfAStoppedServerOnTheOther) {
  const auto first = Serve("-a");
  ServiceClient a(first->channel());
  const std::string job = Train(a, "hang once");
  WaitForState(a, job, v1::JOB_STATE_RUNNING);
  const auto second = Serve("-b");
  ServiceClient b(second->channel());
  first->Signal(SIGSTOP);
  const v1::Job done = WaitForState(b, job, v1::JOB_STATE_SUCCEEDED);
  EXPECT_EQ(FenceOf(job), 2);
  first->Signal(SIGCONT);
  absl::SleepFor(absl::Seconds(2));
  ASSERT_OK_AND_ASSIGN(const v1::Job seen_by_a, a.GetJob(job));
  EXPECT_EQ(seen_by_a.state(), v1::JOB_STATE_SUCCEEDED);
  EXPECT_EQ(seen_by_a.model(), done.model());
  ASSERT_OK_AND_ASSIGN(const auto events_a, a.Watch(job));
  ASSERT_OK_AND_ASSIGN(const auto events_b, b.Watch(job));
  ASSERT_EQ(events_a.size(), events_b.size());
  for (size_t i = 1; i < events_a.size(); ++i) {  // the first is a snapshot, with another time
    EXPECT_EQ(events_a[i].SerializeAsString(), events_b[i].SerializeAsString());
  }
  EXPECT_EQ(testing::FindProcess((folder_ / "data" / job).string()), 0);  // no worker is left
}

TEST_F(SharedDatabaseTest, ResumesJobsOfAServerKnownToBeGoneAtOnce) {
  auto first = Serve("-a");
  const std::string job = [&] {
    ServiceClient a(first->channel());
    const std::string made = Train(a, "hang once");
    WaitForState(a, made, v1::JOB_STATE_RUNNING);
    return made;
  }();
  first->Kill();
  const auto second = Serve("-b");
  ServiceClient b(second->channel());
  WaitForState(b, job, v1::JOB_STATE_SUCCEEDED);
  EXPECT_EQ(FenceOf(job), 2);
}

TEST_F(SharedDatabaseTest, CancelsAJobOfTheOtherServer) {
  const auto first = Serve("-a");
  ServiceClient a(first->channel());
  const std::string job = Train(a, "hang");
  WaitForState(a, job, v1::JOB_STATE_RUNNING);
  const auto second = Serve("-b");
  ServiceClient b(second->channel());
  const absl::Time asked = absl::Now();
  ASSERT_OK(b.CancelJob(job));
  WaitForState(b, job, v1::JOB_STATE_CANCELLED);
  EXPECT_LT(absl::Now() - asked, testing::TimeLimit(absl::Seconds(5)));
  // The other server reads its events as they appear.
  ASSERT_OK_AND_ASSIGN(const auto events, b.Watch(job));
  EXPECT_EQ(events.back().state_changed().state(), v1::JOB_STATE_CANCELLED);
}

// No job is lost, and none is run twice, since the database recovers before the leases expire.
TEST_F(SharedDatabaseTest, KeepsAllJobsWhenTheDatabaseIsKilled) {
  const auto first = Serve("-a", 60);
  const auto second = Serve("-b", 60);
  ServiceClient a(first->channel());
  ServiceClient b(second->channel());
  std::vector<std::string> jobs;
  for (int i = 0; i < 6; ++i) jobs.push_back(Train(i % 2 == 0 ? a : b, "work a while"));
  database_.Crash();
  const absl::StatusOr<v1::Job> away = a.GetJob(jobs[0]);
  EXPECT_TRUE(absl::IsUnavailable(away.status())) << away.status();
  absl::SleepFor(absl::Seconds(1));
  database_.Restart();
  std::set<std::string> models;
  for (const std::string& job : jobs) {
    const v1::Job done = WaitForState(a, job, v1::JOB_STATE_SUCCEEDED);
    EXPECT_EQ(FenceOf(job), 1) << job;
    EXPECT_TRUE(models.insert(done.model()).second);
  }
}

TEST_F(SharedDatabaseTest, RefusesAServerWithAnotherDatabaseOnTheDirectory) {
  const auto first = Serve("-a");
  PepesegdProcess alone(folder_ / "data",
                        testing::PepesegdOptions{{}, {}, PEPESEG_FAKE_WORKER, "-alone", true});
  EXPECT_FALSE(alone.alive());
  EXPECT_NE(alone.Log().find("another server uses this data directory"), std::string::npos);
}

}  // namespace
}  // namespace pepeseg
