#include "tests/server/store/trained_store.h"

namespace pepeseg {
namespace {

using absl::StatusCode::kAlreadyExists;
using absl::StatusCode::kNotFound;

class StoreSelectionsTest : public testing::TrainedStoreTest {
 protected:
  // Creates a selection with the next number.
  absl::StatusOr<SelectionRecord> Make(int64_t model, const std::string& request_id = "",
                                       const std::string& digest = "d") {
    const auto number = store_->selections().TakeSelectionNumber(SceneOf(*store_, "a"));
    if (!number.ok()) return number.status();
    SelectionRecord row;
    row.scene = SceneOf(*store_, "a");
    row.number = *number;
    row.model = model;
    row.model_gaussians = 1000;
    row.num_gaussians = 70;
    row.min = {-1.1, 0.1, 1e-300};
    row.max = {2.5, 3.25, 4};
    row.base = base_;
    row.display_name = "the red mug";
    row.file = "selections/a/x";
    row.request_id = request_id;
    row.request_digest = digest;
    return store_->selections().CreateSelection(row);
  }

  int64_t base_ = 0;
};

TEST_F(StoreSelectionsTest, KeepsEveryColumnAfterReopening) {
  ASSERT_OK(Make(1));
  base_ = 1;
  ASSERT_OK_AND_ASSIGN(const SelectionRecord made, Make(2, "r", "digest"));
  EXPECT_NEAR(absl::ToDoubleSeconds(absl::Now() - made.create_time), 0, 60);
  Reopen();
  ASSERT_OK_AND_ASSIGN(const SelectionRecord found,
                       store_->selections().GetSelection(SceneOf(*store_, "a"), 2));
  EXPECT_EQ(found.scene.name, "a");
  EXPECT_EQ(found.number, 2);
  EXPECT_EQ(found.model, 2);
  EXPECT_EQ(found.model_gaussians, 1000);
  EXPECT_EQ(found.num_gaussians, 70);
  EXPECT_EQ(found.min, (std::array<double, 3>{-1.1, 0.1, 1e-300}));
  EXPECT_EQ(found.max, (std::array<double, 3>{2.5, 3.25, 4}));
  EXPECT_EQ(found.base, 1);
  EXPECT_EQ(found.display_name, "the red mug");
  EXPECT_EQ(found.file, "selections/a/x");
  EXPECT_EQ(found.request_id, "r");
  EXPECT_EQ(found.request_digest, "digest");
  EXPECT_EQ(found.create_time, made.create_time);
}

TEST_F(StoreSelectionsTest, NeverReusesNumbers) {
  ASSERT_OK(Make(1));
  ASSERT_OK_AND_ASSIGN(const SelectionRecord second, Make(1));
  EXPECT_EQ(second.number, 2);
  ASSERT_OK(store_->selections().DeleteSelection(SceneOf(*store_, "a"), 2));
  EXPECT_STATUS(store_->selections().GetSelection(SceneOf(*store_, "a"), 2), kNotFound,
                "scenes/a/selections/2");
  EXPECT_STATUS(store_->selections().DeleteSelection(SceneOf(*store_, "a"), 2), kNotFound,
                "scenes/a/selections/2");
  ASSERT_OK_AND_ASSIGN(const SelectionRecord third, Make(1));
  EXPECT_EQ(third.number, 3);
  EXPECT_STATUS(store_->selections().TakeSelectionNumber(SceneOf(*store_, "none")), kNotFound,
                "scenes/none");
}

TEST_F(StoreSelectionsTest, ReturnsTheSameSelectionToARetry) {
  ASSERT_OK_AND_ASSIGN(const auto nothing, store_->selections().FindSelectionOfRequest(
                                               SceneOf(*store_, "a"), "r", "d"));
  EXPECT_FALSE(nothing.has_value());
  ASSERT_OK_AND_ASSIGN(const SelectionRecord first, Make(1, "r"));
  ASSERT_OK_AND_ASSIGN(const auto found, store_->selections().FindSelectionOfRequest(
                                             SceneOf(*store_, "a"), "r", "d"));
  ASSERT_TRUE(found.has_value());
  EXPECT_EQ(found->number, first.number);
  ASSERT_OK_AND_ASSIGN(const SelectionRecord again, Make(1, "r"));
  EXPECT_EQ(again.number, first.number);
  EXPECT_STATUS(Make(1, "r", "other"), kAlreadyExists, "'r'");
  EXPECT_STATUS(store_->selections().FindSelectionOfRequest(SceneOf(*store_, "a"), "r", "other"),
                kAlreadyExists, "scenes/a/selections/1");
  ASSERT_OK_AND_ASSIGN(const auto unnamed,
                       store_->selections().FindSelectionOfRequest(SceneOf(*store_, "a"), "", "d"));
  EXPECT_FALSE(unnamed.has_value());
  ASSERT_OK(Make(1));
  ASSERT_OK(Make(1));
}

TEST_F(StoreSelectionsTest, RequiresItsModelAndItsBase) {
  EXPECT_STATUS(Make(3), kNotFound, "scenes/a/models/3");
  base_ = 9;
  EXPECT_STATUS(Make(1), kNotFound, "scenes/a/selections/9");
}

TEST_F(StoreSelectionsTest, ListsNewestFirstInPages) {
  for (int i = 0; i < 5; ++i) ASSERT_OK(Make(1));
  std::vector<int64_t> numbers;
  PageRequest page = {2, ""};
  do {
    ASSERT_OK_AND_ASSIGN(const auto selections,
                         store_->selections().ListSelections(SceneOf(*store_, "a"), page));
    for (const SelectionRecord& row : selections.records) numbers.push_back(row.number);
    page.page_token = selections.next_page_token;
  } while (!page.page_token.empty());
  EXPECT_EQ(numbers, (std::vector<int64_t>{5, 4, 3, 2, 1}));
  ASSERT_OK_AND_ASSIGN(const auto none,
                       store_->selections().ListSelections(SceneOf(*store_, "b"), {}));
  EXPECT_TRUE(none.records.empty());
}

TEST_F(StoreSelectionsTest, DeletesSelectionsWithTheirModelOrScene) {
  ASSERT_OK(Make(1));
  ASSERT_OK(Make(2));
  base_ = 1;
  ASSERT_OK(Make(2));
  ASSERT_OK(store_->models().DeleteModel(SceneOf(*store_, "a"), 1));
  EXPECT_STATUS(store_->selections().GetSelection(SceneOf(*store_, "a"), 1), kNotFound,
                "selections/1");
  ASSERT_OK_AND_ASSIGN(const SelectionRecord made_of_it,
                       store_->selections().GetSelection(SceneOf(*store_, "a"), 3));
  EXPECT_EQ(made_of_it.base, 1);
  ASSERT_OK(store_->scenes().DeleteScene(SceneOf(*store_, "a")));
  ASSERT_OK(store_->scenes().CreateScene(NewScene("a")));
  EXPECT_STATUS(store_->selections().GetSelection(SceneOf(*store_, "a"), 2), kNotFound,
                "selections/2");
}

}  // namespace
}  // namespace pepeseg
