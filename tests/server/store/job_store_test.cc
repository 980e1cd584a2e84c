// Jobs, and the models that they make.
#include <gmock/gmock.h>

#include <atomic>
#include <string>
#include <thread>
#include <vector>

#include "tests/server/store/store_fixture.h"
#include "tests/testing/status_testing.h"

namespace pepeseg {
namespace {

using ::testing::HasSubstr;

TEST_F(StoreTest, AllowsOneActiveJobPerScene) {
  MakeTrainable("a");
  MakeTrainable("b");
  ASSERT_OK_AND_ASSIGN(const auto first, Train("a", "r1"));
  EXPECT_EQ(first.id, "j1");
  EXPECT_EQ(first.state, JobState::kQueued);
  EXPECT_EQ(first.options, std::string("\0opt\xff", 5));
  EXPECT_EQ(Train("a", "r1")->id, "j1");
  EXPECT_STATUS(Train("a", "r2"), absl::StatusCode::kAborted, "jobs/j1");
  EXPECT_EQ(Train("b", "r1")->id, "j2");
  ASSERT_OK(store_->queue().RequestCancel("j1"));
  EXPECT_EQ(Train("a", "r2")->id, "j3");
}

TEST_F(StoreTest, LetsOneOfManyThreadsCreateAJob) {
  MakeTrainable("a");
  std::atomic<int> num_ok = 0;
  std::atomic<int> num_aborted = 0;
  std::vector<std::thread> threads;
  threads.reserve(8);
  for (int i = 0; i < 8; ++i) {
    threads.emplace_back([&] {
      const auto job = Train("a");
      num_ok += job.ok() ? 1 : 0;
      num_aborted += absl::IsAborted(job.status()) ? 1 : 0;
    });
  }
  for (std::thread& thread : threads) thread.join();
  EXPECT_EQ(num_ok, 1);
  EXPECT_EQ(num_aborted, 7);
}

TEST_F(StoreTest, RefusesToTrainAnOpenDataset) {
  MakeScene("a");
  ASSERT_OK(
      store_->datasets().CreateDataset(SceneOf(*store_, "a"), "", {{"x", 1, 10, "aa", false}}));
  EXPECT_EQ(Train("a").status().code(), absl::StatusCode::kFailedPrecondition);
}

TEST_F(StoreTest, ClaimsTheOldestJobFirstWithARisingFence) {
  MakeTrainable("a");
  MakeTrainable("b");
  ASSERT_OK(Train("a"));
  ASSERT_OK(Train("b"));
  const auto claimed = store_->queue().ClaimJob("cpu");
  ASSERT_TRUE(claimed.ok() && claimed->has_value()) << claimed.status();
  EXPECT_EQ((*claimed)->id, "j1");
  EXPECT_EQ((*claimed)->fence, 1);
  EXPECT_EQ((*claimed)->device, "cpu");
  EXPECT_EQ((*store_->queue().ClaimJob("cpu"))->id, "j2");
  EXPECT_FALSE(store_->queue().ClaimJob("cpu")->has_value());
  ASSERT_OK(store_->queue().RequeueJob("j1", 1, {}));
  EXPECT_EQ((*store_->queue().ClaimJob("cuda"))->fence, 2);
  EXPECT_EQ(store_->jobs().GetJob("j1")->device, "cuda");
  // The first attempt has lost its claim and can no longer change anything.
  EXPECT_EQ(store_->queue().SetJobStage("j1", 1, "features").code(), absl::StatusCode::kAborted);
  EXPECT_EQ(store_->queue().CommitModel("j1", 1, {}).status().code(), absl::StatusCode::kAborted);
  EXPECT_EQ(store_->queue().EndJob("j1", 1, absl::InternalError("x")).status().code(),
            absl::StatusCode::kAborted);
  EXPECT_EQ(store_->jobs().GetJob("j1")->state, JobState::kRunning);
}

TEST_F(StoreTest, CommitsAModelWithItsJob) {
  MakeTrainable("a");
  ASSERT_OK(Train("a"));
  EXPECT_STATUS(store_->models().GetLiveModel(SceneOf(*store_, "a")),
                absl::StatusCode::kFailedPrecondition, "jobs/j1");
  ASSERT_TRUE((*store_->queue().ClaimJob("cpu")).has_value());
  ModelRecord model;
  model.folder = "jobs/j1/attempt-1";
  model.metrics = R"({"psnr": 21.5})";
  model.num_bytes = 12;
  ASSERT_OK(store_->queue().CommitModel("j1", 1, model));
  Reopen();
  EXPECT_EQ(store_->jobs().GetJob("j1")->state, JobState::kSucceeded);
  EXPECT_EQ(store_->jobs().GetJob("j1")->model, 1);
  ASSERT_OK_AND_ASSIGN(const auto live, store_->models().GetLiveModel(SceneOf(*store_, "a")));
  EXPECT_EQ(live.folder, model.folder);
  EXPECT_EQ(live.metrics, model.metrics);
  EXPECT_EQ(live.job, "j1");
  EXPECT_EQ(live.dataset, 1);
}

TEST_F(StoreTest, NewestModelIsLiveAndNumbersAreNotReused) {
  MakeTrainable("a");
  for (int i = 1; i <= 3; ++i) {
    ASSERT_OK_AND_ASSIGN(const auto job, Train("a"));
    ASSERT_TRUE((*store_->queue().ClaimJob("cpu")).has_value());
    ASSERT_OK(store_->queue().CommitModel(job.id, 1, {}));
  }
  EXPECT_EQ(store_->models().GetLiveModel(SceneOf(*store_, "a"))->number, 3);
  const auto page = store_->models().ListModels(SceneOf(*store_, "a"), {2, ""});
  ASSERT_EQ(page->records.size(), 2u);
  EXPECT_EQ(page->records[0].number, 3);
  EXPECT_EQ(store_->models()
                .ListModels(SceneOf(*store_, "a"), {2, page->next_page_token})
                ->records.at(0)
                .number,
            1);
  ASSERT_OK(store_->models().DeleteModel(SceneOf(*store_, "a"), 3));
  EXPECT_EQ(store_->models().GetLiveModel(SceneOf(*store_, "a"))->number, 2);
  EXPECT_EQ(store_->models().DeleteModel(SceneOf(*store_, "a"), 3).code(),
            absl::StatusCode::kNotFound);
  const auto job = Train("a");
  ASSERT_TRUE((*store_->queue().ClaimJob("cpu")).has_value());
  EXPECT_EQ(store_->queue().CommitModel(job->id, 1, {})->number, 4);
}

TEST_F(StoreTest, MakesAnOlderModelLiveUntilTheNextOneIsMade) {
  MakeTrainable("a");
  const auto live = [&] { return store_->models().GetLiveModel(SceneOf(*store_, "a"))->number; };
  const auto train = [&] {
    const auto job = Train("a");
    ASSERT_OK(job);
    ASSERT_TRUE((*store_->queue().ClaimJob("cpu")).has_value());
    ASSERT_OK(store_->queue().CommitModel(job->id, 1, {}));
  };
  train(), train(), train();
  ASSERT_OK(store_->models().SetLiveModel(SceneOf(*store_, "a"), 1));
  EXPECT_EQ(live(), 1);
  Reopen();
  EXPECT_EQ(live(), 1);
  EXPECT_EQ(store_->models().SetLiveModel(SceneOf(*store_, "a"), 9).code(),
            absl::StatusCode::kNotFound);
  ASSERT_OK(store_->models().DeleteModel(SceneOf(*store_, "a"), 1));
  EXPECT_EQ(live(), 3) << "it was live before";
  ASSERT_OK(store_->models().SetLiveModel(SceneOf(*store_, "a"), 2));
  train();
  EXPECT_EQ(live(), 4);
}

TEST_F(StoreTest, RecordsACorrectedModel) {
  MakeTrainable("a");
  ASSERT_OK(Train("a"));
  ASSERT_TRUE((*store_->queue().ClaimJob("cpu")).has_value());
  ModelRecord model;
  model.metrics = R"({"psnr": 21.5})";
  ASSERT_OK_AND_ASSIGN(model, store_->queue().CommitModel("j1", 1, model));
  model.made_from = model.number;
  ASSERT_OK_AND_ASSIGN(model.number, store_->models().TakeModelNumber(SceneOf(*store_, "a")));
  model.folder = "models/1/2";
  model.num_bytes = 7;
  ASSERT_OK(store_->models().CreateVersion(model));
  Reopen();
  ASSERT_OK_AND_ASSIGN(const auto live, store_->models().GetLiveModel(SceneOf(*store_, "a")));
  EXPECT_EQ(live.number, 2);
  EXPECT_EQ(live.made_from, 1);
  EXPECT_EQ(live.folder, "models/1/2");
  EXPECT_EQ(live.metrics, model.metrics);
  EXPECT_EQ(live.job, "j1");
  EXPECT_EQ(live.dataset, 1);
  ASSERT_OK(store_->models().DeleteModel(SceneOf(*store_, "a"), 1));
  model.number = 3;
  EXPECT_EQ(store_->models().CreateVersion(model).status().code(), absl::StatusCode::kNotFound)
      << "the model that it was corrected from is gone";
}

TEST_F(StoreTest, EndsAJobWithItsReason) {
  MakeTrainable("a");
  ASSERT_OK(Train("a"));
  ASSERT_TRUE((*store_->queue().ClaimJob("cpu")).has_value());
  ASSERT_OK(store_->queue().EndJob("j1", 1, absl::InvalidArgumentError("images/x.jpg: no")));
  const auto job = store_->jobs().GetJob("j1");
  EXPECT_EQ(job->state, JobState::kFailed);
  EXPECT_EQ(job->error_code, 3);
  EXPECT_EQ(job->error_message, "images/x.jpg: no");
  EXPECT_EQ(store_->queue().RequestCancel("j1")->state, JobState::kFailed);
}

TEST_F(StoreTest, CancelsARequeuedJobThatWasAskedToStop) {
  MakeTrainable("a");
  ASSERT_OK(Train("a"));
  ASSERT_TRUE((*store_->queue().ClaimJob("cpu")).has_value());
  EXPECT_EQ(store_->queue().RequestCancel("j1")->state, JobState::kRunning);
  EXPECT_TRUE(store_->jobs().GetJob("j1")->cancel_requested);
  ASSERT_OK(store_->queue().SetJobStage("j1", 1, "features"));
  EXPECT_EQ(store_->queue().RequeueJob("j1", 1, {})->state, JobState::kCancelled);
  EXPECT_EQ(store_->jobs().GetJob("j1")->stage, "features") << "the stage in which it ended";
}

TEST_F(StoreTest, KeepsTheStageInWhichAJobFailed) {
  MakeTrainable("a");
  ASSERT_OK(Train("a"));
  ASSERT_TRUE((*store_->queue().ClaimJob("cpu")).has_value());
  ASSERT_OK(store_->queue().SetJobStage("j1", 1, "sfm"));
  ASSERT_OK(store_->queue().EndJob("j1", 1, absl::InvalidArgumentError("no pairs")));
  EXPECT_EQ(store_->jobs().GetJob("j1")->stage, "sfm");
}

TEST_F(StoreTest, ListsJobsNewestFirstByFilter) {
  for (const char* scene : {"a", "b", "c"}) {
    MakeTrainable(scene);
    ASSERT_OK(Train(scene));
  }
  ASSERT_TRUE((*store_->queue().ClaimJob("cpu")).has_value());
  const auto all = store_->jobs().ListJobs({}, {2, ""});
  ASSERT_EQ(all->records.size(), 2u);
  EXPECT_EQ(all->records[0].id, "j3");
  EXPECT_EQ(store_->jobs().ListJobs({}, {2, all->next_page_token})->records.at(0).id, "j1");
  EXPECT_EQ(store_->jobs().ListJobs({SceneOf(*store_, "b"), {}}, {})->records.at(0).id, "j2");
  EXPECT_EQ(store_->jobs().ListJobs({std::nullopt, JobState::kRunning}, {})->records.size(), 1u);
  EXPECT_EQ(store_->jobs().ListJobs({SceneOf(*store_, "none"), {}}, {}).status().code(),
            absl::StatusCode::kNotFound);
}

}  // namespace
}  // namespace pepeseg
