// Claims and leases of several servers on one database.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <set>
#include <thread>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"
#include "server/store/soci.h"
#include "server/store/store.h"
#include "tests/server/store/scene_of.h"
#include "tests/server/store/test_database.h"
#include "tests/testing/eventually.h"
#include "tests/testing/status_testing.h"
#include "tests/testing/temp_folder.h"

namespace pepeseg {
namespace {

using ::testing::HasSubstr;

class StoreQueueTest : public ::testing::Test {
 protected:
  std::unique_ptr<Store> Open(const std::string& name, absl::Duration lease) {
    auto store = Store::Open(url_, {name, lease});
    EXPECT_OK(store);
    return *std::move(store);
  }

  // Creates a queued job of a new scene and returns its id.
  std::string Queue(Store& store, const std::string& project = kDefaultProject,
                    bool preview = false) {
    const std::string scene = absl::StrCat("s", ++num_scenes_);
    EXPECT_OK(store.scenes().CreateScene(NewScene(scene, "", "", project)));
    EXPECT_OK(
        store.datasets().CreateDataset(SceneOf(store, scene), "", {{"a.jpg", 1, 3, "00", true}}));
    EXPECT_OK(store.datasets().SealDataset(SceneOf(store, scene), 1));
    JobRecord job;
    job.scene = SceneOf(store, scene);
    job.dataset = 1;
    job.preview = preview;
    const auto made = store.jobs().CreateJob(job);
    EXPECT_OK(made);
    return made->id;
  }

  // Claims a job as soon as there is one, after the end of a lease or of a pause.
  std::optional<JobRecord> AwaitClaim(Store& store, const std::string& device) {
    std::optional<JobRecord> claimed;
    EXPECT_TRUE(testing::Eventually([&] {
      claimed = store.queue().ClaimJob(device).value_or(std::nullopt);
      return claimed.has_value();
    }));
    return claimed;
  }

  const testing::TempFolder folder_;
  const std::string url_ = testing::NewTestDatabase(folder_.path());
  int num_scenes_ = 0;
};

TEST_F(StoreQueueTest, DoesNotClaimAJobWhoseLeaseIsRenewed) {
  // Renews a lease beyond its first end. False: a busy machine has stopped this thread for as long
  // as the lease, so that it says nothing that the job was lost.
  const auto renew = [&](absl::Duration lease) {
    const auto a = Open("a", lease);
    const auto b = Open("b", absl::Seconds(60));
    const std::string job = Queue(*a);
    const auto claimed = a->queue().ClaimJob("cpu");
    EXPECT_TRUE(claimed.ok() && claimed->has_value() && (*claimed)->fence == 1);
    const absl::Time start = absl::Now();
    absl::Time renewed = start;
    while (absl::Now() < start + 1.5 * lease) {
      absl::SleepFor(lease / 10);
      const absl::Time before = absl::Now();
      const auto held = a->queue().RenewLeases();
      const auto taken = b->queue().ClaimJob("cpu");
      if (absl::Now() - renewed > 0.9 * lease) {
        // Whoever holds it now: the next try must not find it.
        a->queue().EndJob(job, 1, absl::CancelledError()).IgnoreError();
        b->queue().EndJob(job, 2, absl::CancelledError()).IgnoreError();
        return false;
      }
      renewed = before;
      EXPECT_TRUE(held.ok() && held->size() == 1 && held->front().id == job) << held.status();
      EXPECT_TRUE(taken.ok() && !taken->has_value()) << taken.status();
    }
    EXPECT_OK(a->queue().EndJob(job, 1, absl::CancelledError()));
    return true;
  };
  EXPECT_TRUE(renew(absl::Milliseconds(600)) || renew(absl::Seconds(4)) ||
              renew(absl::Seconds(15)));
}

TEST_F(StoreQueueTest, ClaimsForTheProjectThatRunsTheFewestJobs) {
  const auto store = Open("a", absl::Seconds(60));
  const std::string first = Queue(*store, "many");
  const std::string second = Queue(*store, "many");
  const std::string third = Queue(*store, "many");
  const std::string late = Queue(*store, "few");
  std::vector<std::string> claimed;
  for (int i = 0; i < 4; ++i) {
    ASSERT_OK_AND_ASSIGN(const std::optional<JobRecord> job, store->queue().ClaimJob("cpu"));
    ASSERT_TRUE(job.has_value());
    claimed.push_back(job->id);
  }
  EXPECT_THAT(claimed, ::testing::ElementsAre(first, late, second, third));
}

TEST_F(StoreQueueTest, ClaimsForTheProjectWhoseJobsRanTheLeast) {
  const auto store = Open("a", absl::Seconds(60));
  const std::string ended = Queue(*store, "before");
  ASSERT_OK_AND_ASSIGN(const std::optional<JobRecord> ran, store->queue().ClaimJob("cpu"));
  ASSERT_TRUE(ran.has_value());
  absl::SleepFor(absl::Milliseconds(2));
  EXPECT_OK(store->queue().EndJob(ended, 1, absl::InternalError("x")));
  const std::string older = Queue(*store, "before");
  const std::string newer = Queue(*store, "now");
  for (const std::string& next : {newer, older}) {
    ASSERT_OK_AND_ASSIGN(const std::optional<JobRecord> job, store->queue().ClaimJob("cpu"));
    ASSERT_TRUE(job.has_value());
    EXPECT_EQ(job->id, next);
  }
}

TEST_F(StoreQueueTest, ClaimsWhatWasPutBackThenPreviewsThenTheRest) {
  const auto store = Open("a", absl::Seconds(60));
  const std::string back = Queue(*store);
  ASSERT_OK_AND_ASSIGN(const std::optional<JobRecord> runs, store->queue().ClaimJob("cpu"));
  const std::string rest = Queue(*store);
  EXPECT_EQ(*store->queue().FindPreview(), "");
  const std::string preview = Queue(*store, kDefaultProject, true);
  EXPECT_EQ(*store->queue().FindPreview(), preview);
  ASSERT_OK_AND_ASSIGN(
      const JobRecord queued,
      store->queue().RequeueJob(back, runs->fence, {AttemptEnd::kPutBack, true, {}}));
  EXPECT_EQ(queued.put_backs, 1);
  for (const std::string& next : {back, preview, rest}) {
    ASSERT_OK_AND_ASSIGN(const std::optional<JobRecord> job, store->queue().ClaimJob("cpu"));
    ASSERT_TRUE(job.has_value());
    EXPECT_EQ(job->id, next);
    EXPECT_EQ(job->preview, next == preview);
  }
}

TEST_F(StoreQueueTest, ListsWhatIsClaimableInTheOrderOfClaims) {
  const auto store = Open("a", absl::Seconds(60));
  EXPECT_TRUE(store->queue().ListClaimable()->empty());
  std::vector<std::string> jobs;
  for (const bool preview : {false, false, true, false}) {
    jobs.push_back(Queue(*store, kDefaultProject, preview));
  }
  // One runs, and one pauses.
  EXPECT_EQ((*store->queue().ClaimJob("cpu"))->id, jobs[2]);
  EXPECT_EQ((*store->queue().ClaimJob("cpu"))->id, jobs[0]);
  ASSERT_OK(store->queue().RequeueJob(jobs[0], 1, {AttemptEnd::kCrashed, false, absl::Hours(1)}));
  jobs.push_back(Queue(*store, kDefaultProject, true));
  const auto number = [](const std::string& id) { return std::stoll(id.substr(1)); };
  const std::vector<int64_t> want = {number(jobs[4]), number(jobs[1]), number(jobs[3])};
  EXPECT_EQ(*store->queue().ListClaimable(), want);
  for (const int64_t next : want) EXPECT_EQ((*store->queue().ClaimJob("cpu"))->number, next);
  EXPECT_TRUE(store->queue().ListClaimable()->empty());
}

TEST_F(StoreQueueTest, ClaimsOnlyPreviewsOnRequest) {
  const auto store = Open("a", absl::Seconds(60));
  using Claims = JobQueue::Claims;
  Queue(*store);
  ASSERT_OK_AND_ASSIGN(std::optional<JobRecord> job,
                       store->queue().ClaimJob("cpu", Claims::kPreviews));
  EXPECT_FALSE(job.has_value());
  const std::string preview = Queue(*store, kDefaultProject, true);
  ASSERT_OK_AND_ASSIGN(job, store->queue().ClaimJob("cpu", Claims::kPreviews));
  ASSERT_TRUE(job.has_value());
  EXPECT_EQ(job->id, preview);
}

// Previews come first, but do not stop others for ever.
TEST_F(StoreQueueTest, ClaimsAJobThatHasWaitedForLongInTheOrderOfPreviews) {
  const auto store = Open("a", absl::Seconds(60));
  const std::string waits = Queue(*store);
  const std::string preview = Queue(*store, kDefaultProject, true);
  const bool is_sqlite = url_.starts_with("sqlite:");
  soci::session sql = is_sqlite ? soci::session(soci::sqlite3, "dbname=\"" + url_.substr(7) + "\"")
                                : soci::session(**PostgresqlBackend(), url_.substr(11));
  sql << "UPDATE jobs SET create_time = create_time - 601000000";
  for (const std::string& next : {waits, preview}) {
    ASSERT_OK_AND_ASSIGN(const std::optional<JobRecord> job, store->queue().ClaimJob("cpu"));
    ASSERT_TRUE(job.has_value());
    EXPECT_EQ(job->id, next);
  }
}

TEST_F(StoreQueueTest, RefusesWritesAfterTheLeaseIsLost) {
  const auto a = Open("a", absl::Milliseconds(50));
  const auto b = Open("b", absl::Seconds(60));
  const std::string job = Queue(*a);
  ASSERT_TRUE((*a->queue().ClaimJob("cpu")).has_value());
  const std::optional<JobRecord> claimed = AwaitClaim(*b, "cuda 0");
  ASSERT_TRUE(claimed.has_value());
  EXPECT_EQ(claimed->id, job);
  EXPECT_EQ(claimed->fence, 2);
  EXPECT_TRUE(absl::IsAborted(a->queue().SetJobStage(job, 1, "features")));
  EXPECT_TRUE(absl::IsAborted(a->queue().CommitModel(job, 1, {}).status()));
  EXPECT_TRUE(absl::IsAborted(a->queue().EndJob(job, 1, absl::InternalError("x")).status()));
  EXPECT_TRUE(absl::IsAborted(a->queue().RequeueJob(job, 1, {}).status()));
  // The fence of the other attempt does not help.
  EXPECT_TRUE(absl::IsAborted(a->queue().CommitModel(job, 2, {}).status()));
  ASSERT_OK_AND_ASSIGN(const std::vector<JobRecord> held, a->queue().RenewLeases());
  EXPECT_TRUE(held.empty());
  ASSERT_OK_AND_ASSIGN(const JobRecord row, b->jobs().GetJob(job));
  EXPECT_EQ(row.state, JobState::kRunning);
  EXPECT_EQ(row.stage, "");
  EXPECT_EQ(row.lease_owner, "b");
  EXPECT_OK(b->queue().CommitModel(job, 2, {}));
}

TEST_F(StoreQueueTest, ChangesOnlyTheHolderOfALaunchedJob) {
  const auto a = Open("a", absl::Milliseconds(50));
  const auto b = Open("b", absl::Seconds(60));
  const std::string job = Queue(*a);
  ASSERT_TRUE((*a->queue().ClaimJob("cpu")).has_value());
  ASSERT_OK(a->queue().SetJobLaunch(job, 1, "slurm:17"));
  const std::optional<JobRecord> claimed = AwaitClaim(*b, "cpu");
  ASSERT_TRUE(claimed.has_value());
  EXPECT_EQ(claimed->fence, 1);
  EXPECT_EQ(claimed->launch, "slurm:17");
  EXPECT_TRUE(absl::IsAborted(a->queue().CommitModel(job, 1, {}).status()));
  EXPECT_OK(b->queue().CommitModel(job, 1, {}));
}

TEST_F(StoreQueueTest, GivesARestartedWorkerTheNextFenceOfItsLaunchOnly) {
  const auto a = Open("a", absl::Seconds(60));
  const std::string job = Queue(*a);
  ASSERT_TRUE((*a->queue().ClaimJob("cpu")).has_value());
  ASSERT_OK(a->queue().SetJobLaunch(job, 1, "slurm:17"));
  const auto worker = Open("worker", absl::Seconds(60));
  EXPECT_TRUE(absl::IsAborted(worker->queue().TakeNextFence(job, "slurm:16").status()));
  ASSERT_OK_AND_ASSIGN(const int64_t fence, worker->queue().TakeNextFence(job, "slurm:17"));
  EXPECT_EQ(fence, 2);
  EXPECT_TRUE(absl::IsAborted(a->queue().CommitModel(job, 1, {}).status()));
  EXPECT_OK(a->queue().CommitModel(job, 2, {}));
  EXPECT_TRUE(absl::IsAborted(worker->queue().TakeNextFence(job, "slurm:17").status()));
}

TEST_F(StoreQueueTest, TakesOverJobsOfTheGivenHolderOnly) {
  const auto a = Open("a", absl::Seconds(60));
  const auto b = Open("b", absl::Seconds(60));
  const std::string job = Queue(*a);
  ASSERT_TRUE((*a->queue().ClaimJob("cpu")).has_value());
  EXPECT_TRUE(absl::IsAborted(b->queue().TakeOverJob(job, "c").status()));
  ASSERT_OK(b->queue().TakeOverJob(job, "a"));
  EXPECT_TRUE(absl::IsAborted(a->queue().RequeueJob(job, 1, {}).status()));
  ASSERT_OK_AND_ASSIGN(const JobRecord row, b->queue().RequeueJob(job, 1, {}));
  EXPECT_EQ(row.lease_owner, "");
}

TEST_F(StoreQueueTest, CountsCrashesAndServerEndsSeparatelyUntilThereIsProgress) {
  const auto a = Open("a", absl::Seconds(60));
  const std::string job = Queue(*a);
  struct Case {
    EndedAttempt attempt;
    int crashes, server_ends;
  };
  const std::vector<Case> cases = {
      {{AttemptEnd::kServerEnded, false, {}}, 0, 1}, {{AttemptEnd::kCrashed, false, {}}, 1, 1},
      {{AttemptEnd::kServerEnded, false, {}}, 1, 2}, {{AttemptEnd::kStopped, false, {}}, 1, 2},
      {{AttemptEnd::kCrashed, false, {}}, 2, 2},     {{AttemptEnd::kCrashed, true, {}}, 0, 0},
      {{AttemptEnd::kServerEnded, true, {}}, 0, 0}};
  int64_t fence = 0;
  for (const Case& each : cases) {
    ASSERT_TRUE((*a->queue().ClaimJob("cpu")).has_value());
    ASSERT_OK_AND_ASSIGN(const JobRecord row, a->queue().RequeueJob(job, ++fence, each.attempt));
    EXPECT_EQ(row.crashes, each.crashes) << "fence " << fence;
    EXPECT_EQ(row.server_ends, each.server_ends) << "fence " << fence;
    ASSERT_OK_AND_ASSIGN(const JobRecord read, a->jobs().GetJob(job));
    EXPECT_EQ(read.crashes, each.crashes);
    EXPECT_EQ(read.server_ends, each.server_ends);
  }
}

TEST_F(StoreQueueTest, ClaimsAPausedJobAfterItsPauseAndOthersBefore) {
  const auto a = Open("a", absl::Seconds(60));
  const std::string job = Queue(*a), other = Queue(*a);
  ASSERT_EQ((*a->queue().ClaimJob("cpu"))->id, job);
  ASSERT_OK_AND_ASSIGN(
      const JobRecord row,
      a->queue().RequeueJob(job, 1, {AttemptEnd::kCrashed, false, absl::Seconds(1)}));
  EXPECT_EQ(row.state, JobState::kQueued);
  EXPECT_EQ((*a->queue().ClaimJob("cpu"))->id, other);
  EXPECT_FALSE((*a->queue().ClaimJob("cpu")).has_value());
  const std::optional<JobRecord> claimed = AwaitClaim(*a, "cpu");
  ASSERT_TRUE(claimed.has_value());
  EXPECT_GE(absl::Now(), row.not_before);
  EXPECT_EQ(claimed->fence, 2);
  EXPECT_EQ(claimed->not_before, absl::InfinitePast());
}

// Several threads claim at the same time until nothing is left; no job is claimed twice.
TEST_F(StoreQueueTest, GivesEachJobToOneOfManyClaimers) {
  constexpr int kNumJobs = 40;
  constexpr int kNumServers = 4;
  const auto first = Open("first", absl::Seconds(60));
  for (int i = 0; i < kNumJobs; ++i) Queue(*first);
  std::vector<std::vector<std::string>> taken(kNumServers);
  std::vector<std::unique_ptr<Store>> stores;
  std::vector<std::thread> servers;
  for (int i = 0; i < kNumServers; ++i) {
    stores.push_back(Open(absl::StrCat("server", i), absl::Seconds(60)));
  }
  for (int i = 0; i < kNumServers; ++i) {
    servers.emplace_back([&, i] {
      while (true) {
        const auto job = stores[i]->queue().ClaimJob("cpu");
        if (absl::IsUnavailable(job.status())) continue;  // too many collisions: try again
        ASSERT_OK(job);
        if (!job->has_value()) return;
        taken[i].push_back((*job)->id);
      }
    });
  }
  for (std::thread& server : servers) server.join();
  std::multiset<std::string> all;
  for (const auto& jobs : taken) all.insert(jobs.begin(), jobs.end());
  EXPECT_EQ(all.size(), static_cast<size_t>(kNumJobs));
  EXPECT_EQ(std::set<std::string>(all.begin(), all.end()).size(), all.size());
}

// Numbers name resources, so two servers must not use one twice.
TEST_F(StoreQueueTest, GivesEachNumberOnceToConcurrentCallers) {
  const auto a = Open("a", absl::Seconds(60));
  const auto b = Open("b", absl::Seconds(60));
  ASSERT_OK(a->scenes().CreateScene(NewScene("s")));
  const SceneRef scene = SceneOf(*a, "s");
  std::vector<int64_t> numbers[2];
  std::thread threads[2];
  for (int i = 0; i < 2; ++i) {
    threads[i] = std::thread([&, i] {
      for (int k = 0; k < 50; ++k) {
        const auto number = (i == 0 ? a : b)->selections().TakeSelectionNumber(scene);
        ASSERT_OK(number);
        numbers[i].push_back(*number);
      }
    });
  }
  for (std::thread& thread : threads) thread.join();
  std::set<int64_t> all(numbers[0].begin(), numbers[0].end());
  all.insert(numbers[1].begin(), numbers[1].end());
  EXPECT_EQ(all.size(), 100u);
}

TEST(Store, ReconnectsWhenPostgresqlComesBack) {
  testing::PostgresqlServer server;
  auto store = Store::Open(server.NewDatabase(), {"a", absl::Seconds(60)});
  ASSERT_OK(store);
  ASSERT_OK((*store)->scenes().CreateScene(NewScene("s")));
  server.Crash();
  absl::Status away;  // the backend of the connection may answer once more before it ends
  EXPECT_TRUE(testing::Eventually(
      [&] {
        away = (*store)->scenes().GetScene(SceneOf(**store, "s")).status();
        return !away.ok();
      },
      absl::Seconds(2)));
  EXPECT_TRUE(absl::IsUnavailable(away)) << away;
  EXPECT_THAT(std::string(away.message()), HasSubstr("database"));
  server.Restart();
  EXPECT_OK((*store)->scenes().GetScene(SceneOf(**store, "s")));  // what was committed is there
  EXPECT_OK((*store)->scenes().CreateScene(NewScene("t")));
}

}  // namespace
}  // namespace pepeseg
