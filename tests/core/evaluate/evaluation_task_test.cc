#include "core/evaluate/evaluation_task.h"

#include <gtest/gtest.h>

#include "tests/testing/status_testing.h"

namespace pepeseg {
namespace {

constexpr int kSide = 20;

std::vector<uint8_t> Rows(int first, int count) {
  std::vector<uint8_t> mask(size_t{kSide} * kSide);
  std::fill_n(mask.begin() + ptrdiff_t{first} * kSide, count * kSide, uint8_t{1});
  return mask;
}

TruthView ViewWith(const std::string& name,
                   const std::map<std::string, std::vector<uint8_t>>& masks, bool held_out = true) {
  ModelView view;
  view.name = name;
  view.camera = {kSide, kSide, 20, 20, 10, 10};
  view.held_out = held_out;
  TruthViewBuilder builder(view);
  for (const auto& [entity, mask] : masks) EXPECT_OK(builder.AddMask(entity, mask));
  return std::move(builder).Build();
}

EntityPrompt MaskPrompt(const std::string& entity, const std::string& view) {
  return {entity, view, BinaryMask{Rows(0, 1)}};
}

TEST(MakeTask, TakesTheFirstViewThatShowsEnoughAsReference) {
  EvaluationRequest request;
  request.views = {ViewWith("c", {{"mug.1", Rows(0, 6)}, {"tray", Rows(0, 9)}}),
                   ViewWith("a", {{"mug.1", Rows(0, 4)}}), ViewWith("b", {{"mug.1", Rows(0, 5)}})};
  ASSERT_OK_AND_ASSIGN(const EvaluationTask task, MakeTask(request, {}));
  ASSERT_EQ(task.entities.size(), 1u);
  const ScoredEntity& mug = task.entities[0];
  EXPECT_EQ(mug.name, "mug.1");
  EXPECT_EQ(mug.category, "mug");
  EXPECT_EQ(task.views[mug.reference].view.name, "b");  // "a" shows 80 pixels
  EXPECT_EQ(mug.scored, std::vector<size_t>{2});
  EXPECT_EQ(mug.num_pixels, std::vector<int64_t>{120});
  EXPECT_TRUE(std::holds_alternative<DeepestClick>(mug.prompt));
  EXPECT_EQ(task.left_out, std::vector<std::string>{"tray"});

  ASSERT_OK_AND_ASSIGN(const EvaluationTask with_reference,
                       MakeTask(request, {.min_pixels = 80, .score_reference = true}));
  EXPECT_EQ(with_reference.entities[0].scored, (std::vector<size_t>{0, 1, 2}));
  EXPECT_EQ(with_reference.entities[1].scored, std::vector<size_t>{2});  // "tray" by itself
}

TEST(MakeTask, NeedsOneScoredViewIfThePromptIsGiven) {
  EvaluationRequest request;
  request.views = {ViewWith("a", {}), ViewWith("b", {{"mug", Rows(0, 9)}})};
  request.prompts = {MaskPrompt("mug", "a")};
  ASSERT_OK_AND_ASSIGN(const EvaluationTask task, MakeTask(request, {}));
  EXPECT_EQ(task.entities[0].reference, 0u);
  EXPECT_EQ(task.entities[0].scored, std::vector<size_t>{1});
  request.prompts.clear();
  EXPECT_STATUS(MakeTask(request, {}), absl::StatusCode::kInvalidArgument,
                "no entity has a reference view and shows at least 100 pixels in a view to score; "
                "there are 2 views and 1 entities");
}

TEST(MakeTask, DoesNotCountIgnoredPixels) {
  EvaluationRequest request;
  request.views = {ViewWith("a", {{"mug", Rows(0, 6)}}), ViewWith("b", {{"mug", Rows(0, 6)}})};
  request.views[1].ignore = Rows(0, 1);
  ASSERT_OK_AND_ASSIGN(const EvaluationTask task, MakeTask(request, {}));
  EXPECT_EQ(task.entities[0].num_pixels, std::vector<int64_t>{100});
  EXPECT_FALSE(MakeTask(request, {.min_pixels = 101}).ok());
}

TEST(MakeTask, AcceptsTrainedViewsOnlyIfAsked) {
  EvaluationRequest request;
  request.views = {ViewWith("a", {{"mug", Rows(0, 6)}}),
                   ViewWith("b", {{"mug", Rows(0, 6)}}, false)};
  EXPECT_STATUS(MakeTask(request, {}), absl::StatusCode::kInvalidArgument,
                "view \"b\" was trained on; score held-out views");
  request.accept_trained_views = true;
  EXPECT_OK(MakeTask(request, {}));
}

TEST(MakeTask, NamesTheViewOrEntityThatDoesNotFit) {
  const EvaluationRequest good = {
      .views = {ViewWith("a", {{"mug", Rows(0, 6)}}), ViewWith("b", {{"mug", Rows(0, 6)}})},
      .prompts = {},
      .sam_views = {}};
  const auto expect_refused = [](const EvaluationRequest& request, const std::string& message) {
    EXPECT_STATUS(MakeTask(request, {}), absl::StatusCode::kInvalidArgument, message);
  };
  const auto with_prompts = [&](std::vector<EntityPrompt> prompts) {
    EvaluationRequest request = good;
    request.prompts = std::move(prompts);
    return request;
  };
  EvaluationRequest twice = good;
  twice.views.push_back(twice.views[0]);
  expect_refused(twice, "view \"a\" comes twice");
  EvaluationRequest wrong_size = good;
  wrong_size.views[1].ignore.resize(7);
  expect_refused(wrong_size, "view \"b\": 1 names for 1 masks of 400 pixels, 7 ignore values");
  expect_refused(with_prompts({MaskPrompt("cup", "a")}),
                 "the prompt of entity \"cup\" in view \"a\": no view has a mask of this entity");
  expect_refused(with_prompts({MaskPrompt("mug", "x")}), "the request has no such view");
  expect_refused(with_prompts({MaskPrompt("mug", "a"), MaskPrompt("mug", "b")}),
                 "the prompt of entity \"mug\" in view \"b\": the entity has a prompt already");
  expect_refused(with_prompts({{"mug", "a", BinaryMask{{1, 1}}}}), "the mask has 2 pixels");
  expect_refused(with_prompts({{"mug", "a", BoxPrompt{30, 0, 4, 4}}}),
                 "box 30,0 4x4 is outside view \"a\"");
  expect_refused(with_prompts({{"mug", "a", std::vector<PointPrompt>{{3, 25, true}}}}),
                 "point 3,25 is outside view \"a\"");
  expect_refused(with_prompts({{"mug", "a", PointMean{{{3, 2, true}, {3, 3, false}}}}}),
                 "a mean has positive points only");
  expect_refused(with_prompts({{"mug", "a", Scribbles{{Rows(0, 1)}, {{1}}}}}),
                 "the mask has 1 pixels");
  EvaluationRequest without_mask = with_prompts({{"mug", "a", OwnMask{}}});
  without_mask.views[0] = ViewWith("a", {});
  expect_refused(without_mask, "the view has no mask of the entity to take the prompt from");
  EXPECT_STATUS(MakeTask(good, {.min_pixels = 0}), absl::StatusCode::kInvalidArgument,
                "min_pixels is 0");
}

TEST(ReferenceTruthOf, PrefersTheTruthThenTakesMaskOrScribbles) {
  EvaluationRequest request;
  request.views = {ViewWith("a", {{"mug", Rows(0, 6)}}), ViewWith("b", {{"mug", Rows(0, 6)}}),
                   ViewWith("empty", {})};
  request.prompts = {MaskPrompt("mug", "a")};
  ASSERT_OK_AND_ASSIGN(EvaluationTask task, MakeTask(request, {}));
  EXPECT_EQ(ReferenceTruthOf(task, task.entities[0])->mask, Rows(0, 6));

  request.prompts = {MaskPrompt("mug", "empty")};
  ASSERT_OK_AND_ASSIGN(task, MakeTask(request, {}));
  EXPECT_EQ(ReferenceTruthOf(task, task.entities[0])->mask, Rows(0, 1));

  request.prompts = {{"mug", "empty", Scribbles{{Rows(2, 1)}, {Rows(5, 15)}}}};
  ASSERT_OK_AND_ASSIGN(task, MakeTask(request, {}));
  const std::optional<ReferenceTruth> strokes = ReferenceTruthOf(task, task.entities[0]);
  ASSERT_TRUE(strokes);
  EXPECT_EQ(strokes->mask, Rows(2, 1));
  std::vector<uint8_t> between = Rows(0, 5);  // neither stroke covers rows 0, 1, 3 and 4
  std::fill_n(between.begin() + ptrdiff_t{2} * kSide, kSide, uint8_t{0});
  EXPECT_EQ(strokes->ignore, between);

  request.prompts = {{"mug", "empty", Scribbles{{Rows(2, 1)}, {}}}};
  ASSERT_OK_AND_ASSIGN(task, MakeTask(request, {}));
  EXPECT_FALSE(ReferenceTruthOf(task, task.entities[0]));
  request.prompts = {{"mug", "empty", BoxPrompt{1, 1, 4, 4}}};
  ASSERT_OK_AND_ASSIGN(task, MakeTask(request, {}));
  EXPECT_FALSE(ReferenceTruthOf(task, task.entities[0]));
}

}  // namespace
}  // namespace pepeseg
