#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>

#include "absl/strings/str_cat.h"
#include "clients/benchmark/evaluate.h"
#include "clients/benchmark/evaluation_truth.h"
#include "clients/terminal/flags.h"
#include "clients/terminal/picture.h"
#include "tests/testing/status_testing.h"
#include "tests/testing/temp_folder.h"

namespace pepeseg::client::cli {
namespace {

namespace fs = std::filesystem;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::UnorderedElementsAre;

// A folder with truth: a label image of "a.jpg", masks of "b/c.jpg", nothing of "d.jpg".
struct TruthFolder : ::testing::Test {
  TruthFolder() {
    flags.folder = folder.path();
    Write("a.png", EncodePng({2, 1, {3, 7}}));
    Write("b/c/mug.png", EncodePng({2, 1, {0, 255}}));
    Write("b/c/cup.png", EncodePng({2, 1, {255, 255}}));
    for (const char* name : {"a.jpg", "b/c.jpg", "d.jpg", "trained.jpg"}) {
      v1::View& view = views.emplace_back();
      view.set_view(name);
      view.set_held_out(std::string(name) != "trained.jpg");
    }
  }
  std::string Write(const std::string& name, const std::string& bytes) const {
    const fs::path path = folder.path() / name;
    fs::create_directories(path.parent_path());
    std::ofstream(path, std::ios::binary) << bytes;
    return path.string();
  }
  std::vector<std::string> Chosen() const {
    const auto chosen = ViewsToScore(flags, views);
    std::vector<std::string> names;
    if (!chosen.ok()) return {std::string(chosen.status().message())};
    for (const v1::View& view : *chosen) names.push_back(view.view());
    return names;
  }

  testing::TempFolder folder;
  TruthFlags flags;
  std::vector<v1::View> views;
  v1::EvaluateModelRequest request;
};

TEST_F(TruthFolder, ScoresHeldOutViewsUnlessTheUserNamesOthers) {
  EXPECT_THAT(Chosen(), ElementsAre("a.jpg", "b/c.jpg", "d.jpg"));
  flags.views = {"d.jpg", "b/c"};
  EXPECT_THAT(Chosen(), ElementsAre("d.jpg", "b/c.jpg"));
  flags.views = ReadNames(Write("views.txt", "b/c.jpg\n\n a.jpg \n"));
  EXPECT_THAT(Chosen(), ElementsAre("b/c.jpg", "a.jpg"));
  flags.views = {"nowhere.jpg"};
  EXPECT_THAT(Chosen(), ElementsAre("the model has no view \"nowhere.jpg\""));
  flags.views = {"traned.jpg"};
  EXPECT_THAT(Chosen(),
              ElementsAre("the model has no view \"traned.jpg\"; did you mean trained.jpg?"));
  flags.views = {"trained.jpg"};
  EXPECT_THAT(Chosen(), ElementsAre(HasSubstr("was trained on; give --trained-views")));
  flags.trained_views = true;
  EXPECT_THAT(Chosen(), ElementsAre("trained.jpg"));
  flags.views = {};
  EXPECT_EQ(Chosen().size(), 4u);
}

TEST_F(TruthFolder, ReadsLabelImagesAndMasks) {
  flags.ignore = folder.path() / "ignore";
  Write("ignore/a.png", "ignored");
  const auto added = AddTruth(flags, views, request);
  ASSERT_OK(added);
  EXPECT_THAT(added->views_without, ElementsAre("d.jpg", "trained.jpg"));
  ASSERT_EQ(request.views_size(), 2);
  EXPECT_EQ(request.views(0).view(), "a.jpg");
  EXPECT_EQ(request.views(0).labels_png(), EncodePng({2, 1, {3, 7}}));
  EXPECT_EQ(request.views(0).ignore_png(), "ignored");
  EXPECT_EQ(request.views(1).ignore_png(), "");
  ASSERT_EQ(request.views(1).masks_size(), 2);
  EXPECT_EQ(request.views(1).masks(0).entity(), "cup");
  EXPECT_EQ(request.views(1).masks(1).mask().png(), EncodePng({2, 1, {0, 255}}));
  flags.folder = folder.path() / "ignore" / "none";
  v1::EvaluateModelRequest empty;
  const auto none = AddTruth(flags, views, empty);
  EXPECT_TRUE(absl::IsNotFound(none.status()));
  EXPECT_THAT(none.status().message(), HasSubstr("expected a.png or masks in a/"));
}

TEST_F(TruthFolder, ReadsMasksOfSam) {
  Write("d.json", R"([{"segmentation": {"size": [1, 2], "counts": "02"}, "predicted_iou": 0.9,
                       "stability_score": 0.95},
                      {"segmentation": {"size": [1, 2], "counts": "11"}}])");
  const auto without = AddSamMasks(flags, views, request);
  ASSERT_OK(without);
  ASSERT_EQ(request.sam_views_size(), 2) << "masks of b/c.jpg without scores, and d.json";
  EXPECT_EQ(request.sam_views(0).masks_size(), 2);
  EXPECT_FALSE(request.sam_views(0).masks(0).has_predicted_iou());
  const v1::SamViewMasks& sam = request.sam_views(1);
  ASSERT_EQ(sam.masks_size(), 2);
  EXPECT_EQ(sam.masks(0).mask().rle().counts(), "02");
  EXPECT_EQ(sam.masks(0).mask().rle().width(), 2);
  EXPECT_EQ(sam.masks(0).predicted_iou(), 0.9);
  EXPECT_EQ(sam.masks(0).stability(), 0.95);
  EXPECT_FALSE(sam.masks(1).has_stability());
  for (const char* bad : {"{}", "[1]", R"([{"segmentation": {"size": [1], "counts": "02"}}])",
                          R"([{"segmentation": {"size": [1, 2], "counts": [0, "2"]}}])"}) {
    Write("d.json", bad);
    v1::EvaluateModelRequest other;
    EXPECT_TRUE(absl::IsInvalidArgument(AddSamMasks(flags, views, other).status())) << bad;
  }
}

TEST_F(TruthFolder, MakesTheMasksOfAReferenceTheirPrompts) {
  ASSERT_OK(AddTruth(flags, views, request));
  (*request.mutable_entity_names())[7] = "apple";
  ASSERT_OK(AddEntityPrompts({.reference = "a.jpg"}, flags, request));
  ASSERT_EQ(request.own_masks_size(), 2);
  EXPECT_EQ(request.own_masks().at("3"), "a.jpg");
  EXPECT_EQ(request.own_masks().at("apple"), "a.jpg");
  EXPECT_THAT(std::string(AddEntityPrompts({.reference = "d.jpg"}, flags, request).message()),
              HasSubstr("is not scored or has no masks"));
}

// The server finds no entity of void pixels, so they must have no prompt.
TEST_F(TruthFolder, MakesNoPromptOfVoidPixels) {
  const auto prompted = [&] {
    request.clear_own_masks();
    EXPECT_OK(AddEntityPrompts({.reference = "a.jpg"}, flags, request));
    std::vector<std::string> names;
    for (const auto& [entity, view] : request.own_masks()) names.push_back(entity);
    return names;
  };
  Write("a.png", EncodePng({4, 1, {0, 3, 7, 255}}));
  ASSERT_OK(AddTruth(flags, views, request));
  EXPECT_THAT(prompted(), UnorderedElementsAre("3", "7"));
  request.set_ignore_label(7);
  EXPECT_THAT(prompted(), UnorderedElementsAre("3", "255"));
  request.clear_ignore_label();
  (*request.mutable_entity_names())[255] = "mug";
  EXPECT_THAT(prompted(), UnorderedElementsAre("3", "7", "mug"));
  request.clear_entity_names();
  request.mutable_views(0)->set_labels_png(EncodePng({2, 1, {0, 255}}));
  EXPECT_THAT(prompted(), UnorderedElementsAre("255")) << "a binary mask";
}

TEST_F(TruthFolder, AddsReferenceViewsWithoutTruth) {
  ASSERT_OK(AddTruth(flags, views, request));
  const std::string file =
      Write("prompts.txt", "# of the cup\ncup@d.jpg:box:1,2,3,4\n\n3@:label:red\n");
  const EntityPromptFlags prompts = {.prompts = {"mug@a.jpg:points:1,2"}, .file = file};
  ASSERT_OK(AddEntityPrompts(prompts, flags, request));
  ASSERT_EQ(request.prompts_size(), 3);
  EXPECT_EQ(request.prompts().at("cup").box().height(), 4);
  EXPECT_EQ(request.prompts().at("3").label(), "red");
  ASSERT_EQ(request.views_size(), 3);
  EXPECT_EQ(request.views(2).view(), "d.jpg");
  EXPECT_TRUE(request.views(2).labels_png().empty());
}

TEST_F(TruthFolder, ParsesEachKindOfPrompt) {
  const std::string file = Write("strokes.png", "strokes");
  const auto parsed = [](const std::string& text) -> absl::StatusOr<v1::Prompt> {
    v1::EvaluateModelRequest into;
    const auto view = AddEntityPrompt(text, into);
    if (!view.ok()) return view.status();
    return into.prompts().begin()->second;
  };
  EXPECT_FALSE(parsed("mug@a:b.jpg:points:1,2").ok()) << "a view's name ends at the first colon";
  ASSERT_OK(AddEntityPrompt("mug@a.jpg:points:1,2;-3,4.5", request));
  const v1::Prompt& prompt = request.prompts().at("mug");
  EXPECT_EQ(prompt.view().view(), "a.jpg");
  ASSERT_EQ(prompt.points().points_size(), 2);
  EXPECT_FALSE(prompt.points().points(0).negative());
  EXPECT_TRUE(prompt.points().points(1).negative());
  EXPECT_EQ(prompt.points().points(1).x(), 3);
  EXPECT_THAT(std::string(AddEntityPrompt("mug@a.jpg:box:1,2,3,4", request).status().message()),
              HasSubstr("has a prompt already"));
  EXPECT_EQ(parsed("m@a:mean:1,2;3,4")->point_mean().points_size(), 2);
  EXPECT_EQ(parsed("m@a:mask:" + file)->mask().png(), "strokes");
  EXPECT_EQ(parsed("m@a:scribbles:" + file)->scribbles().positive().png(), "strokes");
  EXPECT_FALSE(parsed("m@a:scribbles:" + file)->scribbles().has_negative());
  EXPECT_TRUE(parsed(absl::StrCat("m@a:scribbles:", file, ",", file))->scribbles().has_negative());
  ASSERT_OK(AddEntityPrompt("m@a:own-mask", request));
  EXPECT_EQ(request.own_masks().at("m"), "a");
  for (const char* bad : {"mug", "@a:own-mask", "mug@a", "mug@a:circle:1", "mug@a:points:1",
                          "mug@a:box:1,2,3", "mug@:own-mask", "mug@a:label:red"}) {
    EXPECT_TRUE(absl::IsInvalidArgument(parsed(bad).status())) << bad;
  }
  EXPECT_TRUE(absl::IsNotFound(parsed("m@a:mask:/nowhere.png").status()));
}

}  // namespace
}  // namespace pepeseg::client::cli
