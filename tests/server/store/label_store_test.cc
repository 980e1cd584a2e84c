#include "tests/server/store/trained_store.h"

namespace pepeseg {
namespace {

using absl::StatusCode::kAlreadyExists;
using absl::StatusCode::kInvalidArgument;
using absl::StatusCode::kNotFound;

class StoreLabelsTest : public testing::TrainedStoreTest {
 protected:
  LabelRecord Cup(const std::string& id = "cup", const std::string& request_id = "") {
    return {SceneOf(*store_, "a"),
            id,
            "A c\xc3\xbcp",
            "left/0.jpg",
            96,
            64,
            "0`0:o1",
            17,
            request_id,
            {}};
  }
};

TEST_F(StoreLabelsTest, KeepsEveryColumnAfterReopening) {
  ASSERT_OK_AND_ASSIGN(const LabelRecord made, store_->labels().CreateLabel(Cup("cup", "r1")));
  EXPECT_NEAR(absl::ToDoubleSeconds(absl::Now() - made.create_time), 0, 60);
  Reopen();
  ASSERT_OK_AND_ASSIGN(const LabelRecord found,
                       store_->labels().GetLabel(SceneOf(*store_, "a"), "cup"));
  EXPECT_EQ(found.scene.name, "a");
  EXPECT_EQ(found.id, "cup");
  EXPECT_EQ(found.text, "A c\xc3\xbcp");
  EXPECT_EQ(found.view, "left/0.jpg");
  EXPECT_EQ(found.width, 96);
  EXPECT_EQ(found.height, 64);
  EXPECT_EQ(found.counts, "0`0:o1");
  EXPECT_EQ(found.area, 17);
  EXPECT_EQ(found.request_id, "r1");
  EXPECT_EQ(found.create_time, made.create_time);
}

TEST_F(StoreLabelsTest, RefusesInvalidIdsAndUnknownScenes) {
  for (const char* id : {"", "-a", "_a", ".", "..", "../x", "a/b"}) {
    EXPECT_STATUS(store_->labels().CreateLabel(Cup(id)), kInvalidArgument, "label id");
  }
  LabelRecord label = Cup();
  label.scene = SceneOf(*store_, "none");
  EXPECT_STATUS(store_->labels().CreateLabel(label), kNotFound, "scenes/none");
}

TEST_F(StoreLabelsTest, ReturnsTheSameLabelToARetryAndRefusesAnotherRequest) {
  ASSERT_OK(store_->labels().CreateLabel(Cup("cup", "r1")));
  EXPECT_OK(store_->labels().CreateLabel(Cup("cup", "r1")));
  EXPECT_STATUS(store_->labels().CreateLabel(Cup("cup", "r2")), kAlreadyExists,
                "scenes/a/labels/cup");
  EXPECT_STATUS(store_->labels().CreateLabel(Cup()), kAlreadyExists, "scenes/a/labels/cup");
  EXPECT_STATUS(store_->labels().CreateLabel(Cup("mug", "r1")), kAlreadyExists, "'r1'");
  LabelRecord other = Cup("cup", "r1");
  other.counts = "1";
  EXPECT_STATUS(store_->labels().CreateLabel(other), kAlreadyExists, "'r1'");
  LabelRecord elsewhere = Cup("cup", "r1");
  elsewhere.scene = SceneOf(*store_, "b");
  EXPECT_OK(store_->labels().CreateLabel(elsewhere));
}

TEST_F(StoreLabelsTest, ListsByIdInPages) {
  for (const char* id : {"e", "b", "d", "a", "c"}) ASSERT_OK(store_->labels().CreateLabel(Cup(id)));
  std::string ids;
  PageRequest page = {2, ""};
  int num_pages = 0;
  do {
    ASSERT_OK_AND_ASSIGN(const auto labels,
                         store_->labels().ListLabels(SceneOf(*store_, "a"), page));
    for (const LabelRecord& label : labels.records) ids += label.id;
    page.page_token = labels.next_page_token;
    ++num_pages;
  } while (!page.page_token.empty());
  EXPECT_EQ(ids, "abcde");
  EXPECT_EQ(num_pages, 3);
  ASSERT_OK_AND_ASSIGN(const auto none, store_->labels().ListLabels(SceneOf(*store_, "b"), {}));
  EXPECT_TRUE(none.records.empty());
  ASSERT_OK_AND_ASSIGN(const auto first,
                       store_->labels().ListLabels(SceneOf(*store_, "a"), {1, ""}));
  EXPECT_STATUS(store_->labels().ListLabels(SceneOf(*store_, "b"), {1, first.next_page_token}),
                kInvalidArgument, "page_token");
}

TEST_F(StoreLabelsTest, NamesExistingLabelsWhenOneIsMissing) {
  EXPECT_STATUS(store_->labels().GetLabel(SceneOf(*store_, "a"), "cup"), kNotFound,
                "the scene has no labels");
  ASSERT_OK(store_->labels().CreateLabel(Cup("mug")));
  ASSERT_OK(store_->labels().CreateLabel(Cup("plate")));
  EXPECT_STATUS(store_->labels().GetLabel(SceneOf(*store_, "a"), "cup"), kNotFound,
                "scenes/a/labels/cup does not exist; the scene has mug, plate");
  EXPECT_STATUS(store_->labels().GetLabel(SceneOf(*store_, "none"), "cup"), kNotFound,
                "scenes/none does not exist");
}

TEST_F(StoreLabelsTest, DeletesLabelsSinglyOrWithTheirScene) {
  ASSERT_OK(store_->labels().CreateLabel(Cup("cup")));
  ASSERT_OK(store_->labels().CreateLabel(Cup("mug")));
  ASSERT_OK(store_->labels().DeleteLabel(SceneOf(*store_, "a"), "cup"));
  EXPECT_STATUS(store_->labels().DeleteLabel(SceneOf(*store_, "a"), "cup"), kNotFound,
                "scenes/a/labels/cup");
  EXPECT_OK(store_->labels().GetLabel(SceneOf(*store_, "a"), "mug"));
  ASSERT_OK(store_->scenes().DeleteScene(SceneOf(*store_, "a")));
  ASSERT_OK(store_->scenes().CreateScene(NewScene("a")));
  EXPECT_STATUS(store_->labels().GetLabel(SceneOf(*store_, "a"), "mug"), kNotFound, "no labels");
}

}  // namespace
}  // namespace pepeseg
