#include "server/store/schema.h"

#include <gtest/gtest.h>

#include "absl/strings/str_cat.h"
#include "server/store/soci.h"
#include "server/store/store.h"
#include "tests/testing/status_testing.h"
#include "tests/testing/temp_folder.h"

namespace pepeseg {
namespace {

// Writes a database with the schema of the first release, a finished job and its model.
void WriteFirstVersion(const std::string& path) {
  soci::session sql(soci::sqlite3, absl::StrCat("dbname=\"", path, "\""));
  sql << "CREATE TABLE schema_version (version INTEGER NOT NULL)";
  for (const char* statement : SchemaStep(1)) sql << statement;
  sql << "INSERT INTO schema_version (version) VALUES (1)";
  sql << "INSERT INTO scenes VALUES ('a', 'A', '', 1, 2, 2)";
  sql << "INSERT INTO datasets VALUES ('a', 1, 1, '', 1, 2, 0, 0)";
  sql << "INSERT INTO jobs VALUES (1, 'a', 1, 2, 'index', '', '', '', 1, 0, 0, '', 1, 3, 4, 5)";
  sql << "INSERT INTO models VALUES ('a', 1, 'j1', 'jobs/j1/attempt-1', '{}', 7, 8, 5)";
  sql << "UPDATE job_numbers SET next_job = 2";
  sql << "INSERT INTO dataset_files VALUES ('a', 1, 'images/1.jpg', 1, 20, 'aa', 1)";
  sql << "INSERT INTO dataset_files VALUES ('a', 1, 'images/2.jpg', 1, 20, 'aa', 1)";
}

TEST(Schema, UpgradesTheFirstVersionWithItsRecords) {
  const testing::TempFolder folder;
  const std::string path = (folder.path() / "store.db").string();
  WriteFirstVersion(path);
  ASSERT_OK_AND_ASSIGN(const auto store, Store::Open("sqlite:" + path));
  ASSERT_OK_AND_ASSIGN(const auto job, store->jobs().GetJob("j1"));
  EXPECT_EQ(job.state, JobState::kSucceeded);
  EXPECT_EQ(job.device, "");  // not recorded then
  const auto model = store->models().GetLiveModel("a");
  ASSERT_OK(model);
  EXPECT_EQ(model->num_gaussians, 7);
  EXPECT_EQ(model->device, "");
  EXPECT_EQ(model->sources, "");
  ASSERT_OK_AND_ASSIGN(const auto file, store->files().GetDatasetFile("a", 1, "images/1.jpg"));
  EXPECT_EQ(file.header, HeaderState::kUnread);
  EXPECT_EQ(store->quotas().GetUsage("default")->stored_bytes, 20 + 8) << "a blob and a model";
  JobRow next;
  next.scene = "a";
  next.dataset = 1;
  ASSERT_OK(store->jobs().CreateJob(next));
  EXPECT_EQ((**store->queue().ClaimJob("cuda 0 (X)")).device, "cuda 0 (X)");
}

TEST(Schema, KeepsIdsOfOldScenesAsKeysAndFreesThemForOtherProjects) {
  const testing::TempFolder folder;
  const std::string path = (folder.path() / "store.db").string();
  WriteFirstVersion(path);
  ASSERT_OK_AND_ASSIGN(const auto store, Store::Open("sqlite:" + path));
  EXPECT_EQ(*store->scenes().FindScene("default", "a"), "a");
  EXPECT_EQ(store->scenes().GetScene("a")->display_name, "A");
  EXPECT_TRUE(absl::IsAlreadyExists(store->scenes().CreateScene({"a", "", "", {}}).status()));
  ASSERT_OK_AND_ASSIGN(const auto theirs, store->scenes().CreateScene({"a", "", "", {}, "lab"}));
  EXPECT_NE(theirs.key, "a");
  EXPECT_OK(store->models().GetLiveModel("a"));
  EXPECT_FALSE(store->models().GetLiveModel(theirs.key).ok());
}

TEST(Schema, AddsLabelsAndSelectionsToOldScenesAndModels) {
  const testing::TempFolder folder;
  const std::string path = (folder.path() / "store.db").string();
  WriteFirstVersion(path);
  ASSERT_OK_AND_ASSIGN(const auto store, Store::Open("sqlite:" + path));
  LabelRow label;
  label.scene = "a";
  label.id = "cup";
  EXPECT_OK(store->labels().CreateLabel(label));
  const auto number = store->selections().TakeSelectionNumber("a");
  ASSERT_OK(number);
  EXPECT_EQ(*number, 1);
  SelectionRow selection;
  selection.scene = "a";
  selection.number = *number;
  selection.model = 1;
  EXPECT_OK(store->selections().CreateSelection(selection));
}

}  // namespace
}  // namespace pepeseg
