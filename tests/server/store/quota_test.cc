#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <memory>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"
#include "core/base/status_macros.h"
#include "server/store/error_detail.h"
#include "server/store/store.h"
#include "tests/server/store/scene_of.h"
#include "tests/server/store/test_database.h"
#include "tests/testing/status_testing.h"
#include "tests/testing/temp_folder.h"

namespace pepeseg {
namespace {

using Files = std::vector<DatasetFileRecord>;

struct StoreQuotas : ::testing::Test {
  StoreQuotas() : store(*Store::Open(testing::NewTestDatabase(folder.path()))) {
    for (const char* scene : {"a", "b", "c"}) MakeScene(scene, "lab");
    MakeScene("x", "other");
  }

  void MakeScene(const std::string& id, const std::string& project) {
    ASSERT_OK(store->scenes().CreateScene(NewScene(id, "", "", project)));
  }
  absl::Status Upload(const std::string& scene, const Files& files,
                      const std::string& request_id = "") {
    return store->datasets().CreateDataset(SceneOf(*store, scene), request_id, files).status();
  }
  absl::Status Train(const std::string& scene) {
    const auto dataset = store->datasets().CreateDataset(
        SceneOf(*store, scene), "", {{"a.jpg", 1, 3, absl::StrCat("job", scene), true}});
    RETURN_IF_ERROR(dataset.status());
    RETURN_IF_ERROR(
        store->datasets().SealDataset(SceneOf(*store, scene), dataset->number).status());
    JobRecord job;
    job.scene = SceneOf(*store, scene);
    job.dataset = dataset->number;
    return store->jobs().CreateJob(job).status();
  }
  static void ExpectQuota(const absl::Status& status, const std::string& name,
                          const std::string& need, const std::string& limit) {
    EXPECT_EQ(status.code(), absl::StatusCode::kResourceExhausted) << status;
    const ErrorDetail wanted = {.reason = "QUOTA", .field = name, .limit = limit, .value = need};
    EXPECT_EQ(DetailOf(status), wanted) << status;
  }

  const testing::TempFolder folder;
  std::unique_ptr<Store> store;
};

TEST_F(StoreQuotas, CountsBytesOncePerDigestFromTheirDeclarationOn) {
  ASSERT_OK(store->quotas().SetProjectQuota("lab", {100, 0, 0, 0, 0, 0}));
  ASSERT_OK(Upload("a", {{"1", 1, 60, "d1", false}, {"copy", 1, 60, "d1", false}}, "r1"));
  EXPECT_EQ(store->quotas().GetUsage("lab")->stored_bytes, 60);
  ASSERT_OK(store->files().MarkFilesStored({SceneOf(*store, "a"), 1}, {{"1", 1, 60, "d1"}}));
  EXPECT_EQ(store->quotas().GetUsage("lab")->stored_bytes, 60)
      << "the copy needs no bytes of its own";
  ExpectQuota(Upload("b", {{"2", 1, 41, "d2", false}, {"1", 1, 60, "d1", true}}), "stored_bytes",
              "101", "100");
  EXPECT_EQ(store->quotas().GetUsage("lab")->open_uploads, 1) << "nothing was made of it";
  EXPECT_OK(Upload("b", {{"2", 1, 40, "d2", false}, {"1", 1, 60, "d1", true}}));
  EXPECT_OK(Upload("a", {{"1", 1, 60, "d1", false}, {"copy", 1, 60, "d1", false}}, "r1"))
      << "a retry is no new one";
  EXPECT_OK(Upload("x", {{"1", 1, 1000, "d1", false}})) << "another project";
}

TEST_F(StoreQuotas, CountsCorrectedModelsAndKeepsNoneThatIsTooLarge) {
  ASSERT_OK(Train("a"));
  const auto job = store->queue().ClaimJob("cpu");
  ASSERT_OK(job);
  ModelRecord model;
  model.num_bytes = 40;
  ASSERT_OK_AND_ASSIGN(model, store->queue().CommitModel((*job)->id, 1, model));
  ASSERT_OK(store->quotas().SetProjectQuota("lab", {100, 0, 0, 0, 0, 0}));
  model.made_from = model.number;
  ASSERT_OK_AND_ASSIGN(model.number, store->models().TakeModelNumber(model.scene));
  model.num_bytes = 58;
  ExpectQuota(store->models().CreateVersion(model).status(), "stored_bytes", "101", "100");
  EXPECT_EQ(store->models().GetLiveModel(model.scene)->number, model.made_from);
  model.num_bytes = 57;
  ASSERT_OK(store->models().CreateVersion(model));
  EXPECT_EQ(store->quotas().GetUsage("lab")->stored_bytes, 100);
}

// Each upload has its own partial file for a digest, whose bytes are checked only at the end.
TEST_F(StoreQuotas, CountsAMadeUpDigestInEachUpload) {
  ASSERT_OK(store->quotas().SetProjectQuota("lab", {100, 0, 0, 0, 0, 0}));
  ASSERT_OK(Upload("a", {{"1", 1, 60, "made up", false}}));
  ExpectQuota(Upload("b", {{"1", 1, 60, "made up", false}}), "stored_bytes", "120", "100");
  ASSERT_OK(store->scenes().DeleteScene(SceneOf(*store, "a")));
  EXPECT_OK(Upload("b", {{"1", 1, 60, "made up", false}})) << "what was never stored goes at once";
}

TEST_F(StoreQuotas, CountsADigestDeclaredWithAnotherSize) {
  ASSERT_OK(store->quotas().SetProjectQuota("lab", {100, 0, 0, 0, 0, 0}));
  ASSERT_OK(Upload("a", {{"1", 1, 3, "d1", true}, {"2", 1, 90, "d1", false}}));
  EXPECT_EQ(store->quotas().GetUsage("lab")->stored_bytes, 93);
}

TEST_F(StoreQuotas, CountsDeletedBlobsUntilTheyAreCollected) {
  ASSERT_OK(store->quotas().SetProjectQuota("lab", {100, 0, 0, 0, 0, 0}));
  ASSERT_OK(Upload("a", {{"1", 1, 60, "d1", true}}));
  ASSERT_OK(store->datasets().SealDataset(SceneOf(*store, "a"), 1));
  ASSERT_OK(store->scenes().DeleteScene(SceneOf(*store, "a")));
  EXPECT_EQ(store->quotas().GetUsage("lab")->stored_bytes, 60);
  ExpectQuota(Upload("b", {{"2", 1, 60, "d2", false}}), "stored_bytes", "120", "100");
  EXPECT_OK(Upload("b", {{"1", 1, 60, "d1", true}})) << "it is there";
  ASSERT_OK(store->scenes().DeleteScene(SceneOf(*store, "b")));
  ASSERT_OK(store->files().ForgetBlobs("lab", {"d1"}));
  EXPECT_EQ(store->quotas().GetUsage("lab")->stored_bytes, 0);
  EXPECT_OK(Upload("c", {{"2", 1, 60, "d2", false}}));
}

// A stream may complete a blob after its upload was deleted.
TEST_F(StoreQuotas, CountsBlobsOfUploadsThatAreGone) {
  ASSERT_OK(Upload("a", {{"1", 1, 60, "d1", false}}));
  const SceneRef scene = SceneOf(*store, "a");
  ASSERT_OK(store->scenes().DeleteScene(scene));
  EXPECT_TRUE(absl::IsNotFound(store->files().MarkFilesStored({scene, 1}, {{"1", 1, 60, "d1"}})));
  EXPECT_EQ(store->quotas().GetUsage("lab")->stored_bytes, 60);
}

TEST_F(StoreQuotas, CountsModelsAndSelections) {
  ASSERT_OK(store->quotas().SetProjectQuota("lab", {100, 0, 0, 0, 0, 0}));
  ASSERT_OK(Train("a"));  // of 3 bytes
  const auto job = *store->queue().ClaimJob("cpu");
  ASSERT_TRUE(job.has_value());
  ModelRecord model;
  model.folder = "jobs/j1/attempt-1";
  model.num_bytes = 80;
  ASSERT_OK(store->queue().CommitModel(job->id, job->fence, model));
  EXPECT_EQ(store->quotas().GetUsage("lab")->stored_bytes, 83);
  SelectionRecord selection;
  selection.scene = SceneOf(*store, "a");
  selection.model = 1;
  selection.number = *store->selections().TakeSelectionNumber(SceneOf(*store, "a"));
  selection.num_bytes = 18;
  ExpectQuota(store->selections().CreateSelection(selection).status(), "stored_bytes", "101",
              "100");
  selection.num_bytes = 17;
  ASSERT_OK(store->selections().CreateSelection(selection));
  EXPECT_EQ(store->selections().GetSelection(SceneOf(*store, "a"), 1)->num_bytes, 17);
  ExpectQuota(Upload("b", {{"2", 1, 1, "d2", false}}), "stored_bytes", "101", "100");
  JobRecord next;
  next.scene = SceneOf(*store, "a");
  next.dataset = 1;
  ExpectQuota(store->jobs().CreateJob(next).status(), "stored_bytes", "101", "100");
  ASSERT_OK(store->selections().DeleteSelection(SceneOf(*store, "a"), 1));
  EXPECT_OK(store->jobs().CreateJob(next)) << "there is room for some of a model";
  EXPECT_EQ(store->quotas().GetUsage("lab")->stored_bytes, 83);
}

TEST_F(StoreQuotas, CountsOpenUploadsUntilTheyAreSealed) {
  store->SetDefaultQuota({0, 1, 0, 0, 0, 0});
  ASSERT_OK(Upload("a", {{"1", 1, 3, "d1", true}}));
  ExpectQuota(Upload("b", {{"1", 1, 3, "d1", true}}), "open_uploads", "2", "1");
  EXPECT_OK(Upload("x", {{"1", 1, 3, "d1", true}}));
  ASSERT_OK(store->datasets().SealDataset(SceneOf(*store, "a"), 1));
  EXPECT_OK(Upload("b", {{"1", 1, 3, "d1", true}}));
  ASSERT_OK(store->quotas().SetProjectQuota("lab", {0, 2, 0, 0, 0, 0}));
  EXPECT_OK(Upload("c", {{"1", 1, 3, "d1", true}}));
}

TEST_F(StoreQuotas, ChecksQueuedJobsWhenAJobIsCreated) {
  store->SetDefaultQuota({0, 0, 1, 0, 0, 0});
  ASSERT_OK(Train("a"));
  ExpectQuota(Train("b"), "queued_jobs", "2", "1");
  EXPECT_EQ(store->quotas().GetUsage("lab")->queued_jobs, 1);
  EXPECT_OK(Train("x"));
  ASSERT_TRUE(store->queue().ClaimJob("cpu")->has_value());
  EXPECT_EQ(store->quotas().GetUsage("lab")->running_jobs, 1);
  EXPECT_OK(Train("b")) << "the first one runs";
}

TEST_F(StoreQuotas, PassesOverJobsOfAProjectAtItsQuota) {
  ASSERT_OK(store->quotas().SetProjectQuota("lab", {0, 0, 0, 1, 0, 0}));
  for (const char* scene : {"a", "b", "x"}) ASSERT_OK(Train(scene));
  const auto first = *store->queue().ClaimJob("cpu");
  EXPECT_EQ(first->scene.name, "a");
  const auto second = *store->queue().ClaimJob("cpu");
  ASSERT_TRUE(second.has_value());
  EXPECT_EQ(second->scene.name, "x");
  EXPECT_FALSE((*store->queue().ClaimJob("cpu")).has_value());
  ASSERT_OK(store->queue().EndJob(first->id, first->fence, absl::CancelledError("")));
  const auto third = *store->queue().ClaimJob("cpu");
  ASSERT_TRUE(third.has_value());
  EXPECT_EQ(third->scene.name, "b");
  // With a default for all projects, and no value of its own.
  ASSERT_OK(store->quotas().SetProjectQuota("lab", {}));
  store->SetDefaultQuota({0, 0, 0, 1, 0, 0});
  ASSERT_OK(Train("c"));
  EXPECT_FALSE((*store->queue().ClaimJob("cpu")).has_value());
  store->SetDefaultQuota({0, 0, 0, 2, 0, 0});
  EXPECT_TRUE((*store->queue().ClaimJob("cpu")).has_value());
}

TEST_F(StoreQuotas, AnswersTheQueriesOfTheCollector) {
  ASSERT_OK(Upload("a", {{"1", 1, 3, "d1", true}, {"2", 1, 3, "d2", true}}));
  ASSERT_OK(Upload("b", {{"1", 1, 3, "d1", true}}));
  ASSERT_OK(Upload("x", {{"1", 1, 3, "d3", true}}));
  EXPECT_THAT(*store->files().ListDigests("lab"), ::testing::ElementsAre("d1", "d2"));
  EXPECT_TRUE(store->files().ListDigests("nobody")->empty());
  ASSERT_OK(store->datasets().SealDataset(SceneOf(*store, "a"), 1));
  EXPECT_TRUE(store->datasets().ListOpenUploads(absl::Now() - absl::Hours(1))->empty());
  ASSERT_OK_AND_ASSIGN(const auto open,
                       store->datasets().ListOpenUploads(absl::Now() + absl::Hours(1)));
  ASSERT_EQ(open.size(), 2u);
  EXPECT_EQ(open[0].scene.name, "b");
  EXPECT_TRUE(absl::IsFailedPrecondition(store->datasets().DeleteUpload(SceneOf(*store, "a"), 1)));
  EXPECT_OK(store->datasets().DeleteUpload(SceneOf(*store, "b"), 1));
  EXPECT_TRUE(absl::IsNotFound(store->datasets().DeleteUpload(SceneOf(*store, "b"), 1)));
  EXPECT_EQ(*store->jobs().NextJobNumber(), 1);
  ASSERT_OK(Train("c"));
  EXPECT_EQ(*store->jobs().NextJobNumber(), 2);
}

}  // namespace
}  // namespace pepeseg
