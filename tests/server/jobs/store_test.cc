#include "server/jobs/store.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <thread>

#include "absl/strings/str_cat.h"
#include "tests/server/jobs/test_database.h"
#include "tests/testing/status_testing.h"
#include "tests/testing/temp_folder.h"

namespace pepeseg {
namespace {

using ::testing::HasSubstr;

class StoreTest : public ::testing::Test {
 protected:
  StoreTest() : url_(testing::NewTestDatabase(folder_.path())) { Reopen(); }

  void Reopen() {
    store_.reset();
    auto store = Store::Open(url_);
    ASSERT_TRUE(store.ok()) << store.status();
    store_ = std::move(store).value();
  }

  void MakeScene(const std::string& id) {
    const auto scene = store_->CreateScene({id, "Name of " + id, "", {}});
    ASSERT_TRUE(scene.ok()) << scene.status();
  }

  // A scene with dataset 1, sealed.
  void MakeTrainable(const std::string& id) {
    MakeScene(id);
    ASSERT_TRUE(store_->CreateDataset(id, "", {{"images/a.jpg", 1, 3, "00", true}}).ok());
    ASSERT_TRUE(store_->SealDataset(id, 1).ok());
  }

  absl::StatusOr<JobRow> Train(const std::string& scene, const std::string& request_id = "") {
    JobRow job;
    job.scene = scene;
    job.dataset = 1;
    job.options = std::string("\0opt\xff", 5);
    job.effective_options = "effective";
    job.request_id = request_id;
    return store_->CreateJob(job);
  }

  testing::TempFolder folder_;
  std::string url_;
  std::unique_ptr<Store> store_;
};

TEST_F(StoreTest, KeepsScenesAfterReopening) {
  const auto made = store_->CreateScene({"kitchen", "The kitchen", "r1", {}});
  ASSERT_TRUE(made.ok()) << made.status();
  Reopen();
  const auto found = store_->GetScene("kitchen");
  ASSERT_TRUE(found.ok()) << found.status();
  EXPECT_EQ(found->display_name, "The kitchen");
  EXPECT_EQ(found->create_time, made->create_time);
  EXPECT_NEAR(absl::ToDoubleSeconds(absl::Now() - found->create_time), 0, 60);
}

TEST_F(StoreTest, RefusesIdsThatAreNoNames) {
  const std::vector<std::string> bad = {"",     ".",   "..",  ".a",  "-a", "_a",
                                        "../x", "a/b", "a'b", "a b", "ä",  std::string(64, 'a')};
  for (const std::string& id : bad) {
    const auto status = store_->CreateScene({id, "", "", {}}).status();
    EXPECT_EQ(status.code(), absl::StatusCode::kInvalidArgument) << id;
  }
  EXPECT_TRUE(store_->CreateScene({std::string(63, 'a'), "", "", {}}).ok());
}

TEST_F(StoreTest, SameRequestMakesOneScene) {
  ASSERT_TRUE(store_->CreateScene({"a", "x", "r1", {}}).ok());
  EXPECT_TRUE(store_->CreateScene({"a", "x", "r1", {}}).ok());
  EXPECT_EQ(store_->CreateScene({"b", "x", "r1", {}}).status().code(),
            absl::StatusCode::kAlreadyExists);
  EXPECT_EQ(store_->CreateScene({"a", "x", "r2", {}}).status().code(),
            absl::StatusCode::kAlreadyExists);
  EXPECT_EQ(store_->ListScenes({})->rows.size(), 1u);
}

TEST_F(StoreTest, PagesThroughScenesOnceEach) {
  for (int i = 0; i < 7; ++i) MakeScene(absl::StrCat("s", i));
  std::vector<std::string> seen;
  PageRequest page;
  page.page_size = 3;
  do {
    const auto got = store_->ListScenes(page);
    ASSERT_TRUE(got.ok()) << got.status();
    EXPECT_LE(got->rows.size(), 3u);
    for (const SceneRow& row : got->rows) seen.push_back(row.id);
    page.page_token = got->next_page_token;
  } while (!page.page_token.empty());
  EXPECT_THAT(seen, ::testing::ElementsAre("s0", "s1", "s2", "s3", "s4", "s5", "s6"));
}

TEST_F(StoreTest, RefusesTokensOfOtherLists) {
  for (int i = 0; i < 3; ++i) MakeTrainable(absl::StrCat("s", i));
  ASSERT_TRUE(Train("s0").ok());
  ASSERT_TRUE(Train("s1").ok());
  const std::string token = store_->ListScenes({1, ""})->next_page_token;
  ASSERT_FALSE(token.empty());
  EXPECT_EQ(store_->ListJobs({}, {1, token}).status().code(), absl::StatusCode::kInvalidArgument);
  EXPECT_EQ(store_->ListScenes({1, "?"}).status().code(), absl::StatusCode::kInvalidArgument);
  EXPECT_EQ(store_->ListScenes({-1, ""}).status().code(), absl::StatusCode::kInvalidArgument);
}

TEST_F(StoreTest, SealsOnlyCompleteDatasets) {
  MakeScene("a");
  const auto made = store_->CreateDataset(
      "a", "r", {{"images/1.jpg", 1, 10, "aa", true}, {"images/2.jpg", 1, 20, "bb", false}});
  ASSERT_TRUE(made.ok()) << made.status();
  EXPECT_EQ(made->number, 1);
  EXPECT_EQ(made->num_files, 2);
  EXPECT_EQ(made->num_bytes, 30);
  const auto early = store_->SealDataset("a", 1).status();
  EXPECT_EQ(early.code(), absl::StatusCode::kFailedPrecondition);
  EXPECT_THAT(std::string(early.message()), HasSubstr("images/2.jpg"));
  const UploadName upload{kDefaultProject, "a", 1};
  EXPECT_EQ(store_->MarkFilesStored(upload, {{"images/3.jpg", 1, 20, "bb"}}).code(),
            absl::StatusCode::kNotFound);
  EXPECT_EQ(store_->MarkFilesStored(upload, {{"images/2.jpg", 1, 20, "cc"}}).code(),
            absl::StatusCode::kNotFound)
      << "of another upload of this name, which was deleted since";
  DatasetFileRow second{"images/2.jpg", 1, 20, "bb"};
  second.header = HeaderState::kRead;
  second.width = 640;
  second.height = 480;
  ASSERT_TRUE(store_->MarkFilesStored(upload, {second}).ok());
  const auto stored = store_->GetDatasetFile("a", 1, "images/2.jpg");
  EXPECT_TRUE(stored->stored);
  EXPECT_EQ(stored->header, HeaderState::kRead);
  EXPECT_EQ(stored->width, 640);
  EXPECT_EQ(stored->height, 480);
  const auto sealed = store_->SealDataset("a", 1);
  ASSERT_TRUE(sealed.ok()) << sealed.status();
  EXPECT_EQ(sealed->state, DatasetState::kSealed);
  EXPECT_TRUE(store_->SealDataset("a", 1).ok());
  EXPECT_EQ(store_->MarkFilesStored(upload, {second}).code(),
            absl::StatusCode::kFailedPrecondition);
}

// More files than one statement takes, in every call that has them.
TEST_F(StoreTest, KeepsThousandsOfFiles) {
  constexpr int kFiles = 1000;
  MakeScene("a");
  std::vector<DatasetFileRow> files;
  files.reserve(kFiles);
  for (int i = 0; i < kFiles; ++i) {
    files.push_back({absl::StrCat("images/", 1000 + i, ".jpg"), 1, 10 + i, absl::StrCat("d", i)});
  }
  ASSERT_OK(store_->CreateDataset("a", "", files));
  ASSERT_OK_AND_ASSIGN(auto listed, store_->ListDatasetFilesFrom("a", 1, "images/1500.jpg", 100));
  ASSERT_EQ(listed.size(), 100u);
  EXPECT_EQ(listed[0].path, "images/1500.jpg");
  EXPECT_EQ(listed[99].path, "images/1599.jpg");
  ASSERT_OK(store_->MarkFilesStored({kDefaultProject, "a", 1}, listed));
  EXPECT_EQ(store_->ListBlobs(kDefaultProject)->size(), 100u);
  EXPECT_THAT(std::string(store_->SealDataset("a", 1).status().message()),
              HasSubstr("900 of 1000 files are not uploaded"));
  ASSERT_OK(store_->SealDataset("a", 1, files));
  for (DatasetFileRow& file : files) {
    file.header = HeaderState::kRead;
    file.num_points = 2 * file.size;
  }
  ASSERT_OK(store_->SetFileHeaders("a", 1, files));
  ASSERT_OK_AND_ASSIGN(listed, store_->ListDatasetFiles("a", 1));
  ASSERT_EQ(listed.size(), size_t{kFiles});
  for (const DatasetFileRow& file : listed) {
    EXPECT_TRUE(file.stored);
    EXPECT_EQ(file.num_points, 2 * file.size) << file.path;
  }
  ASSERT_OK(store_->ForgetBlobs(kDefaultProject, {"d0", "d999", "other"}));
  EXPECT_EQ(store_->ListBlobs(kDefaultProject)->size(), 998u);
}

TEST_F(StoreTest, SameRequestMakesOneDataset) {
  MakeScene("a");
  const std::vector<DatasetFileRow> files = {{"x", 1, 10, "aa", false}, {"y", 1, 10, "ab", false}};
  EXPECT_EQ(store_->CreateDataset("a", "r", files)->number, 1);
  EXPECT_EQ(store_->CreateDataset("a", "r", {files[1], files[0]})->number, 1);
  EXPECT_EQ(store_->CreateDataset("a", "r", {files[0]}).status().code(),
            absl::StatusCode::kAlreadyExists);
  EXPECT_EQ(store_->CreateDataset("a", "", files)->number, 2);
  EXPECT_EQ(store_->CreateDataset("b", "", files).status().code(), absl::StatusCode::kNotFound);
}

TEST_F(StoreTest, ListsSealedDatasetsByNumber) {
  MakeScene("a");
  for (int i = 0; i < 4; ++i) {
    ASSERT_TRUE(store_->CreateDataset("a", "", {{"x", 1, 10, "aa", true}}).ok());
  }
  for (const int64_t number : {4, 1, 2}) ASSERT_TRUE(store_->SealDataset("a", number).ok());
  const auto page = store_->ListDatasets("a", {2, ""});
  ASSERT_EQ(page->rows.size(), 2u);
  EXPECT_EQ(page->rows[1].number, 2);
  const auto rest = store_->ListDatasets("a", {2, page->next_page_token});
  ASSERT_EQ(rest->rows.size(), 1u);
  EXPECT_EQ(rest->rows[0].number, 4);
  EXPECT_EQ(rest->next_page_token, "");
}

TEST_F(StoreTest, TrainsASceneOnceAtATime) {
  MakeTrainable("a");
  MakeTrainable("b");
  const auto first = Train("a", "r1");
  ASSERT_TRUE(first.ok()) << first.status();
  EXPECT_EQ(first->id, "j1");
  EXPECT_EQ(first->state, JobState::kQueued);
  EXPECT_EQ(first->options, std::string("\0opt\xff", 5));
  EXPECT_EQ(Train("a", "r1")->id, "j1");
  const auto second = Train("a", "r2").status();
  EXPECT_EQ(second.code(), absl::StatusCode::kAborted);
  EXPECT_THAT(std::string(second.message()), HasSubstr("jobs/j1"));
  EXPECT_EQ(Train("b", "r1")->id, "j2");
  ASSERT_TRUE(store_->RequestCancel("j1").ok());
  EXPECT_EQ(Train("a", "r2")->id, "j3");
}

TEST_F(StoreTest, OneOfManyThreadsGetsToTrain) {
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
  ASSERT_TRUE(store_->CreateDataset("a", "", {{"x", 1, 10, "aa", false}}).ok());
  EXPECT_EQ(Train("a").status().code(), absl::StatusCode::kFailedPrecondition);
}

TEST_F(StoreTest, ClaimsOldestFirstWithARisingFence) {
  MakeTrainable("a");
  MakeTrainable("b");
  ASSERT_TRUE(Train("a").ok());
  ASSERT_TRUE(Train("b").ok());
  const auto claimed = store_->ClaimJob("cpu");
  ASSERT_TRUE(claimed.ok() && claimed->has_value()) << claimed.status();
  EXPECT_EQ((*claimed)->id, "j1");
  EXPECT_EQ((*claimed)->fence, 1);
  EXPECT_EQ((*claimed)->device, "cpu");
  EXPECT_EQ((*store_->ClaimJob("cpu"))->id, "j2");
  EXPECT_FALSE(store_->ClaimJob("cpu")->has_value());
  ASSERT_TRUE(store_->RequeueJob("j1", 1, {}).ok());
  EXPECT_EQ((*store_->ClaimJob("cuda"))->fence, 2);
  EXPECT_EQ(store_->GetJob("j1")->device, "cuda");
  // The first attempt lost its claim: it changes nothing any more.
  EXPECT_EQ(store_->SetJobStage("j1", 1, "features").code(), absl::StatusCode::kAborted);
  EXPECT_EQ(store_->CommitModel("j1", 1, {}).status().code(), absl::StatusCode::kAborted);
  EXPECT_EQ(store_->EndJob("j1", 1, absl::InternalError("x")).status().code(),
            absl::StatusCode::kAborted);
  EXPECT_EQ(store_->GetJob("j1")->state, JobState::kRunning);
}

TEST_F(StoreTest, CommitsAModelWithItsJob) {
  MakeTrainable("a");
  ASSERT_TRUE(Train("a").ok());
  const auto none = store_->GetLiveModel("a").status();
  EXPECT_EQ(none.code(), absl::StatusCode::kFailedPrecondition);
  EXPECT_THAT(std::string(none.message()), HasSubstr("jobs/j1"));
  ASSERT_TRUE((*store_->ClaimJob("cpu")).has_value());
  ModelRow model;
  model.folder = "jobs/j1/attempt-1";
  model.metrics = R"({"psnr": 21.5})";
  model.num_bytes = 12;
  ASSERT_TRUE(store_->CommitModel("j1", 1, model).ok());
  Reopen();
  EXPECT_EQ(store_->GetJob("j1")->state, JobState::kSucceeded);
  EXPECT_EQ(store_->GetJob("j1")->model, 1);
  const auto live = store_->GetLiveModel("a");
  ASSERT_TRUE(live.ok()) << live.status();
  EXPECT_EQ(live->folder, model.folder);
  EXPECT_EQ(live->metrics, model.metrics);
  EXPECT_EQ(live->job, "j1");
  EXPECT_EQ(live->dataset, 1);
}

TEST_F(StoreTest, NewestModelIsLiveAndNumbersAreNotReused) {
  MakeTrainable("a");
  for (int i = 1; i <= 3; ++i) {
    const auto job = Train("a");
    ASSERT_TRUE(job.ok()) << job.status();
    ASSERT_TRUE((*store_->ClaimJob("cpu")).has_value());
    ASSERT_TRUE(store_->CommitModel(job->id, 1, {}).ok());
  }
  EXPECT_EQ(store_->GetLiveModel("a")->number, 3);
  const auto page = store_->ListModels("a", {2, ""});
  ASSERT_EQ(page->rows.size(), 2u);
  EXPECT_EQ(page->rows[0].number, 3);
  EXPECT_EQ(store_->ListModels("a", {2, page->next_page_token})->rows.at(0).number, 1);
  ASSERT_TRUE(store_->DeleteModel("a", 3).ok());
  EXPECT_EQ(store_->GetLiveModel("a")->number, 2);
  EXPECT_EQ(store_->DeleteModel("a", 3).code(), absl::StatusCode::kNotFound);
  const auto job = Train("a");
  ASSERT_TRUE((*store_->ClaimJob("cpu")).has_value());
  EXPECT_EQ(store_->CommitModel(job->id, 1, {})->number, 4);
}

TEST_F(StoreTest, EndsAJobWithItsReason) {
  MakeTrainable("a");
  ASSERT_TRUE(Train("a").ok());
  ASSERT_TRUE((*store_->ClaimJob("cpu")).has_value());
  ASSERT_TRUE(store_->EndJob("j1", 1, absl::InvalidArgumentError("images/x.jpg: no")).ok());
  const auto job = store_->GetJob("j1");
  EXPECT_EQ(job->state, JobState::kFailed);
  EXPECT_EQ(job->error_code, 3);
  EXPECT_EQ(job->error_message, "images/x.jpg: no");
  EXPECT_EQ(store_->RequestCancel("j1")->state, JobState::kFailed);
}

TEST_F(StoreTest, DigestsOfAProjectAreMarkedInAllItsDatasets) {
  ASSERT_TRUE(store_->CreateScene({"ours", "", "", {}}).ok());
  ASSERT_TRUE(store_->CreateScene({"theirs", "", "", {}, "other"}).ok());
  for (const char* scene : {"ours", "theirs"}) {
    ASSERT_TRUE(
        store_->CreateDataset(scene, "", {{"a", 1, 3, "00", true}, {"b", 1, 3, "11", true}}).ok());
    ASSERT_TRUE(store_->SealDataset(scene, 1).ok());
  }
  const auto is_stored = [&](const std::string& scene, const std::string& path) {
    return store_->GetDatasetFile(scene, 1, path)->stored;
  };
  ASSERT_TRUE(store_->SetDigestsStored(kDefaultProject, {"00", "22"}, false).ok());
  EXPECT_FALSE(is_stored("ours", "a"));
  EXPECT_TRUE(is_stored("ours", "b"));
  EXPECT_TRUE(is_stored("theirs", "a"));
  ASSERT_TRUE(store_->SetDigestsStored(kDefaultProject, {"00"}, true).ok());
  EXPECT_TRUE(is_stored("ours", "a"));
}

TEST_F(StoreTest, CancelOfARunningJobSurvivesItsRequeue) {
  MakeTrainable("a");
  ASSERT_TRUE(Train("a").ok());
  ASSERT_TRUE((*store_->ClaimJob("cpu")).has_value());
  EXPECT_EQ(store_->RequestCancel("j1")->state, JobState::kRunning);
  EXPECT_TRUE(store_->GetJob("j1")->cancel_requested);
  ASSERT_TRUE(store_->SetJobStage("j1", 1, "features").ok());
  EXPECT_EQ(store_->RequeueJob("j1", 1, {})->state, JobState::kCancelled);
  EXPECT_EQ(store_->GetJob("j1")->stage, "features") << "the stage in which it ended";
}

TEST_F(StoreTest, KeepsTheStageInWhichAJobFailed) {
  MakeTrainable("a");
  ASSERT_TRUE(Train("a").ok());
  ASSERT_TRUE((*store_->ClaimJob("cpu")).has_value());
  ASSERT_TRUE(store_->SetJobStage("j1", 1, "sfm").ok());
  ASSERT_TRUE(store_->EndJob("j1", 1, absl::InvalidArgumentError("no pairs")).ok());
  EXPECT_EQ(store_->GetJob("j1")->stage, "sfm");
}

TEST_F(StoreTest, FindsFilesOfAKind) {
  ASSERT_TRUE(store_->CreateScene({"a", "", "", {}}).ok());
  constexpr int kImage = 1, kMask = 3;
  const std::string digest(64, 'a');
  ASSERT_TRUE(store_->CreateDataset("a", "", {{"images/1.jpg", kImage, 5, digest}}).ok());
  EXPECT_TRUE(*store_->HasFileOfKind("a", 1, kImage));
  EXPECT_FALSE(*store_->HasFileOfKind("a", 1, kMask));
  EXPECT_FALSE(*store_->HasFileOfKind("a", 2, kImage));
}

TEST_F(StoreTest, ListsJobsNewestFirstByFilter) {
  for (const char* scene : {"a", "b", "c"}) {
    MakeTrainable(scene);
    ASSERT_TRUE(Train(scene).ok());
  }
  ASSERT_TRUE((*store_->ClaimJob("cpu")).has_value());
  const auto all = store_->ListJobs({}, {2, ""});
  ASSERT_EQ(all->rows.size(), 2u);
  EXPECT_EQ(all->rows[0].id, "j3");
  EXPECT_EQ(store_->ListJobs({}, {2, all->next_page_token})->rows.at(0).id, "j1");
  EXPECT_EQ(store_->ListJobs({"b", {}}, {})->rows.at(0).id, "j2");
  EXPECT_EQ(store_->ListJobs({"", JobState::kRunning}, {})->rows.size(), 1u);
  EXPECT_EQ(store_->ListJobs({"x' OR 1=1", {}}, {}).status().code(), absl::StatusCode::kNotFound);
}

TEST_F(StoreTest, DeletesOnlyIdleScenes) {
  MakeTrainable("a");
  ASSERT_TRUE(Train("a").ok());
  EXPECT_EQ(store_->DeleteScene("a").code(), absl::StatusCode::kFailedPrecondition);
  ASSERT_TRUE(store_->RequestCancel("j1").ok());
  ASSERT_TRUE(store_->DeleteScene("a").ok());
  EXPECT_EQ(store_->GetScene("a").status().code(), absl::StatusCode::kNotFound);
  EXPECT_EQ(store_->GetJob("j1").status().code(), absl::StatusCode::kNotFound);
  EXPECT_EQ(store_->GetDataset("a", 1).status().code(), absl::StatusCode::kNotFound);
  MakeTrainable("a");
  EXPECT_EQ(Train("a")->id, "j2");
}

TEST(Store, RefusesOtherDatabases) {
  EXPECT_EQ(Store::Open("mysql:x").status().code(), absl::StatusCode::kInvalidArgument);
  EXPECT_EQ(Store::Open("sqlite:/nowhere/at/all.db").status().code(), absl::StatusCode::kInternal);
}

}  // namespace
}  // namespace pepeseg
