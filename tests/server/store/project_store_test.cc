// Keys and projects.
#include <gtest/gtest.h>

#include <set>

#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"
#include "server/store/store.h"
#include "tests/server/store/scene_of.h"
#include "tests/server/store/test_database.h"
#include "tests/testing/status_testing.h"
#include "tests/testing/temp_folder.h"

namespace pepeseg {
namespace {

struct StoreKeys : ::testing::Test {
  StoreKeys() {
    auto opened = Store::Open(testing::NewTestDatabase(folder.path()));
    EXPECT_OK(opened);
    store = *std::move(opened);
  }
  absl::StatusOr<KeyRecord> MakeKey(const std::string& id, const std::string& project) {
    KeyRecord key;
    key.id = id;
    key.project = project;
    key.display_name = "Key's name";
    key.sha256 = absl::StrCat("digest of ", id);
    key.scopes = 6;
    return store->keys().CreateKey(key);
  }
  void CreateScene(const std::string& id, const std::string& project,
                   const std::string& request_id = "") {
    ASSERT_OK_AND_ASSIGN(const SceneRecord made,
                         store->scenes().CreateScene(NewScene(id, "", request_id, project)));
    EXPECT_EQ(made.scene.project, project);
  }

  testing::TempFolder folder;
  std::unique_ptr<Store> store;
};

TEST_F(StoreKeys, FindsAKeyByItsDigest) {
  ASSERT_OK_AND_ASSIGN(const auto made, MakeKey("a", "lab"));
  ASSERT_OK_AND_ASSIGN(const auto found, store->keys().FindKeyByDigest("digest of a"));
  EXPECT_EQ(found.id, "a");
  EXPECT_EQ(found.project, "lab");
  EXPECT_EQ(found.display_name, "Key's name");
  EXPECT_EQ(found.scopes, 6);
  EXPECT_EQ(found.create_time, made.create_time);
  EXPECT_EQ(found.expire_time, absl::InfinitePast());
  EXPECT_EQ(found.revoke_time, absl::InfinitePast());
  EXPECT_TRUE(absl::IsNotFound(store->keys().FindKeyByDigest("digest of b").status()));
  EXPECT_FALSE(MakeKey("a", "lab").ok());
  EXPECT_TRUE(absl::IsInvalidArgument(MakeKey("b", "No label").status()));
  EXPECT_TRUE(absl::IsNotFound(store->keys().FindKeyByDigest("digest of b").status()));
}

TEST_F(StoreKeys, KeepsTheFirstRevocation) {
  ASSERT_OK(MakeKey("a", "lab"));
  ASSERT_OK_AND_ASSIGN(const auto revoked, store->keys().RevokeKey("a"));
  EXPECT_GT(revoked.revoke_time, absl::Now() - absl::Minutes(1));
  EXPECT_EQ(store->keys().RevokeKey("a")->revoke_time, revoked.revoke_time);
  EXPECT_EQ(store->keys().FindKeyByDigest("digest of a")->revoke_time, revoked.revoke_time);
  EXPECT_TRUE(absl::IsNotFound(store->keys().RevokeKey("b").status()));
}

TEST_F(StoreKeys, ListsKeysByProjectInPages) {
  for (const char* id : {"b", "d", "a", "c"}) {
    ASSERT_OK(MakeKey(id, *id == 'c' ? "other" : "lab"));
  }
  ASSERT_OK_AND_ASSIGN(const auto first, store->keys().ListKeys("lab", {2, ""}));
  ASSERT_EQ(first.records.size(), 2u);
  EXPECT_EQ(first.records[0].id, "a");
  const auto second = store->keys().ListKeys("lab", {2, first.next_page_token});
  ASSERT_EQ(second->records.size(), 1u);
  EXPECT_EQ(second->records[0].id, "d");
  EXPECT_EQ(store->keys().ListKeys("", {})->records.size(), 4u);
  EXPECT_EQ(store->keys().ListKeys("none", {})->records.size(), 0u);
  EXPECT_FALSE(
      store->keys().ListKeys("", {2, first.next_page_token}).ok());  // token of another list
  EXPECT_FALSE(store->keys().ListKeys("x' OR '1' = '1", {}).ok());
}

TEST_F(StoreKeys, FindsTheProjectOfScenesAndJobs) {
  CreateScene("a", "lab", "request");
  CreateScene("b", "other", "request");  // the request_id is its own
  EXPECT_EQ(store->scenes().FindScene("lab", "a")->project, "lab");
  ASSERT_OK_AND_ASSIGN(const SceneRef b, store->scenes().FindScene("other", "b"));
  EXPECT_EQ(store->scenes().GetScene({b.id, "", ""})->scene, b);
  EXPECT_TRUE(absl::IsNotFound(store->scenes().FindScene("lab", "b").status()));
  EXPECT_TRUE(absl::IsNotFound(store->scenes().GetScene({b.id + 1, "", ""}).status()));
  EXPECT_TRUE(absl::IsInvalidArgument(store->scenes().FindScene("lab", "../a").status()));
  ASSERT_EQ(store->scenes().ListScenes({}, "lab")->records.size(), 1u);
  EXPECT_EQ(store->scenes().ListScenes({}, "lab")->records[0].scene.name, "a");
  EXPECT_EQ(store->scenes().ListScenes({})->records.size(), 2u);
  for (const char* scene : {"a", "b"}) {
    ASSERT_OK(
        store->datasets().CreateDataset(SceneOf(*store, scene), "", {{"x.jpg", 1, 3, "00", true}}));
    ASSERT_OK(store->datasets().SealDataset(SceneOf(*store, scene), 1));
    JobRecord job;
    job.scene = SceneOf(*store, scene);
    job.dataset = 1;
    ASSERT_OK(store->jobs().CreateJob(job));
  }
  EXPECT_EQ(*store->jobs().ProjectOfJob("j1"), "lab");
  EXPECT_EQ(*store->jobs().ProjectOfJob("j2"), "other");
  EXPECT_TRUE(absl::IsNotFound(store->jobs().ProjectOfJob("j3").status()));
  for (const char* bad : {"", "j", "1", "j0", "j-1", "j01", "j1x"}) {
    EXPECT_TRUE(absl::IsInvalidArgument(store->jobs().ProjectOfJob(bad).status())) << bad;
  }
  JobStore::JobFilter filter;
  filter.project = "other";
  ASSERT_EQ(store->jobs().ListJobs(filter, {})->records.size(), 1u);
  EXPECT_EQ(store->jobs().ListJobs(filter, {})->records[0].id, "j2");
  filter.scene = SceneOf(*store, "a");
  EXPECT_EQ(store->jobs().ListJobs(filter, {})->records.size(), 0u);
  EXPECT_EQ(store->jobs().ListJobs({}, {})->records.size(), 2u);
}

TEST_F(StoreKeys, AllowsTheSameSceneIdInSeveralProjects) {
  CreateScene("a", "lab");
  CreateScene("a", "other");
  CreateScene("b", "other");
  ASSERT_OK_AND_ASSIGN(const SceneRef ours, store->scenes().FindScene("lab", "a"));
  ASSERT_OK_AND_ASSIGN(const SceneRef theirs, store->scenes().FindScene("other", "a"));
  EXPECT_NE(ours.id, theirs.id);
  EXPECT_EQ(store->scenes().GetScene(theirs)->scene, theirs);
  EXPECT_TRUE(absl::IsNotFound(store->scenes().FindScene("lab", "b").status()));
  EXPECT_TRUE(absl::IsNotFound(store->scenes().FindScene("default", "a").status()));
  EXPECT_EQ(store->scenes().CreateScene(NewScene("a", "", "", "other")).status().message(),
            "scenes/a exists already");
  EXPECT_EQ(store->scenes().FindScenes("a")->size(), 2u);
  // Records of one scene do not belong to the other.
  ASSERT_OK(store->datasets().CreateDataset(theirs, "", {{"x.jpg", 1, 3, "00", true}}));
  EXPECT_TRUE(absl::IsNotFound(store->datasets().GetDataset(ours, 1).status()));
  ASSERT_OK(store->scenes().DeleteScene(ours));
  EXPECT_OK(store->datasets().GetDataset(theirs, 1));
  CreateScene("a", "lab");
  EXPECT_NE(store->scenes().FindScene("lab", "a")->id, ours.id) << "ids are never used twice";
}

TEST_F(StoreKeys, ListsScenesWithTheSameIdInPages) {
  for (const char* project : {"lab", "other", "third"}) CreateScene("a", project);
  CreateScene("A", "lab");
  CreateScene("a-b", "lab");
  std::set<int64_t> ids;
  PageRequest page{1, ""};
  do {
    ASSERT_OK_AND_ASSIGN(const auto scenes, store->scenes().ListScenes(page));
    ASSERT_EQ(scenes.records.size(), 1u);
    EXPECT_TRUE(ids.insert(scenes.records[0].scene.id).second);
    page.page_token = scenes.next_page_token;
  } while (!page.page_token.empty() && ids.size() < 10);
  EXPECT_EQ(ids.size(), 5u);
}

TEST_F(StoreKeys, StoresQuotasOfProjects) {
  EXPECT_EQ(store->quotas().GetProject("lab")->quota.stored_bytes, 0);
  ASSERT_OK(store->quotas().SetProjectQuota("lab", {1, 2, 3, 4, 5, int64_t{6} << 40}));
  ASSERT_OK(MakeKey("a", "lab"));  // does not change the quota
  const auto project = store->quotas().GetProject("lab");
  EXPECT_EQ(project->quota.stored_bytes, 1);
  EXPECT_EQ(project->quota.queries_per_second, 5);
  EXPECT_EQ(project->quota.resident_bytes, int64_t{6} << 40);
  EXPECT_TRUE(absl::IsInvalidArgument(store->quotas().SetProjectQuota("No", {}).status()));
}

}  // namespace
}  // namespace pepeseg
