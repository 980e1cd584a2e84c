// Scenes, and the database as a whole.
#include <gmock/gmock.h>

#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"
#include "tests/server/store/store_fixture.h"
#include "tests/testing/status_testing.h"

namespace pepeseg {
namespace {

TEST_F(StoreTest, KeepsScenesAfterReopening) {
  ASSERT_OK_AND_ASSIGN(const auto made,
                       store_->scenes().CreateScene(NewScene("kitchen", "The kitchen", "r1")));
  Reopen();
  ASSERT_OK_AND_ASSIGN(const auto found, store_->scenes().GetScene(SceneOf(*store_, "kitchen")));
  EXPECT_EQ(found.display_name, "The kitchen");
  EXPECT_EQ(found.create_time, made.create_time);
  EXPECT_NEAR(absl::ToDoubleSeconds(absl::Now() - found.create_time), 0, 60);
}

TEST_F(StoreTest, RefusesInvalidIds) {
  const std::vector<std::string> bad = {"",     ".",   "..",  ".a",  "-a", "_a",
                                        "../x", "a/b", "a'b", "a b", "ä",  std::string(64, 'a')};
  for (const std::string& id : bad) {
    const auto status = store_->scenes().CreateScene(NewScene(id)).status();
    EXPECT_EQ(status.code(), absl::StatusCode::kInvalidArgument) << id;
  }
  EXPECT_OK(store_->scenes().CreateScene(NewScene(std::string(63, 'a'))));
}

TEST_F(StoreTest, CreatesOneSceneForARepeatedRequest) {
  ASSERT_OK(store_->scenes().CreateScene(NewScene("a", "x", "r1")));
  EXPECT_OK(store_->scenes().CreateScene(NewScene("a", "x", "r1")));
  EXPECT_EQ(store_->scenes().CreateScene(NewScene("b", "x", "r1")).status().code(),
            absl::StatusCode::kAlreadyExists);
  EXPECT_EQ(store_->scenes().CreateScene(NewScene("a", "x", "r2")).status().code(),
            absl::StatusCode::kAlreadyExists);
  EXPECT_EQ(store_->scenes().ListScenes({})->records.size(), 1u);
}

TEST_F(StoreTest, ListsEachSceneOnceInPages) {
  for (int i = 0; i < 7; ++i) MakeScene(absl::StrCat("s", i));
  std::vector<std::string> seen;
  PageRequest page;
  page.page_size = 3;
  do {
    ASSERT_OK_AND_ASSIGN(const auto got, store_->scenes().ListScenes(page));
    EXPECT_LE(got.records.size(), 3u);
    for (const SceneRecord& row : got.records) seen.push_back(row.scene.name);
    page.page_token = got.next_page_token;
  } while (!page.page_token.empty());
  EXPECT_THAT(seen, ::testing::ElementsAre("s0", "s1", "s2", "s3", "s4", "s5", "s6"));
}

TEST_F(StoreTest, RefusesTokensOfOtherLists) {
  for (int i = 0; i < 3; ++i) MakeTrainable(absl::StrCat("s", i));
  ASSERT_OK(Train("s0"));
  ASSERT_OK(Train("s1"));
  const std::string token = store_->scenes().ListScenes({1, ""})->next_page_token;
  ASSERT_FALSE(token.empty());
  EXPECT_EQ(store_->jobs().ListJobs({}, {1, token}).status().code(),
            absl::StatusCode::kInvalidArgument);
  EXPECT_EQ(store_->scenes().ListScenes({1, "?"}).status().code(),
            absl::StatusCode::kInvalidArgument);
  EXPECT_EQ(store_->scenes().ListScenes({-1, ""}).status().code(),
            absl::StatusCode::kInvalidArgument);
}

TEST_F(StoreTest, DeletesOnlyIdleScenes) {
  MakeTrainable("a");
  ASSERT_OK(Train("a"));
  EXPECT_EQ(store_->scenes().DeleteScene(SceneOf(*store_, "a")).code(),
            absl::StatusCode::kFailedPrecondition);
  ASSERT_OK(store_->queue().RequestCancel("j1"));
  ASSERT_OK(store_->scenes().DeleteScene(SceneOf(*store_, "a")));
  EXPECT_EQ(store_->scenes().GetScene(SceneOf(*store_, "a")).status().code(),
            absl::StatusCode::kNotFound);
  EXPECT_EQ(store_->jobs().GetJob("j1").status().code(), absl::StatusCode::kNotFound);
  EXPECT_EQ(store_->datasets().GetDataset(SceneOf(*store_, "a"), 1).status().code(),
            absl::StatusCode::kNotFound);
  MakeTrainable("a");
  EXPECT_EQ(Train("a")->id, "j2");
}

TEST(Store, RefusesUnknownDatabaseUrls) {
  EXPECT_EQ(Store::Open("mysql:x").status().code(), absl::StatusCode::kInvalidArgument);
  EXPECT_EQ(Store::Open("sqlite:/nowhere/at/all.db").status().code(), absl::StatusCode::kInternal);
}

}  // namespace
}  // namespace pepeseg
