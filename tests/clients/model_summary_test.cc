#include "clients/terminal/model_summary.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "absl/strings/str_format.h"

namespace pepeseg::client::cli {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;

TEST(SourcesText, FollowsTheOrderOfTheStages) {
  v1::Model model;
  EXPECT_EQ(SourcesText(model), "");
  model.mutable_sources()->set_depth("none");
  model.mutable_sources()->set_masks("command sam");
  model.mutable_sources()->set_poses("COLMAP 3.8");
  EXPECT_EQ(SourcesText(model), "poses COLMAP 3.8, masks command sam, depth none");
}

TEST(MaskQualityText, ExplainsTheNumber) {
  v1::Model model;
  EXPECT_EQ(MaskQualityText(model), "");
  (*model.mutable_metrics())["mask_quality"] = 0.789;
  EXPECT_EQ(MaskQualityText(model),
            "mask quality 0.79: how far the masks of different views agree, 0 to 1");
}

v1::View Scored(const std::string& name, double psnr, double ssim) {
  v1::View view;
  view.set_view(name);
  view.mutable_scores()->set_psnr(psnr);
  view.mutable_scores()->set_ssim(ssim);
  return view;
}

TEST(ScoreTable, ShowsTheHeldOutViewsAndTheirMean) {
  v1::View trained;
  trained.set_view("b.jpg");
  const std::vector<v1::View> views = {Scored("a/long_name.jpg", 21, 0.75), trained,
                                       Scored("c.jpg", 24.5, 0.875)};
  EXPECT_THAT(ScoreTable(views), ElementsAre("held-out view      PSNR    SSIM",  //
                                             "a/long_name.jpg   21.00   0.750",  //
                                             "c.jpg             24.50   0.875",  //
                                             "mean of 2         22.75   0.812"));
}

TEST(ScoreTable, ShowsLpipsIfItWasMeasured) {
  std::vector<v1::View> views = {Scored("a.jpg", 21, 0.75)};
  views[0].mutable_scores()->set_lpips(0.125);
  EXPECT_THAT(ScoreTable(views), ElementsAre("held-out view    PSNR    SSIM   LPIPS",
                                             "a.jpg           21.00   0.750   0.125",
                                             "mean of 1       21.00   0.750   0.125"));
}

TEST(ScoreTable, ShowsTheWorstOfManyViews) {
  std::vector<v1::View> views;
  views.reserve(50);
  for (int i = 0; i < 50; ++i) views.push_back(Scored(absl::StrFormat("%02d", i), 50 - i, 0.5));
  const std::vector<std::string> rows = ScoreTable(views);
  ASSERT_EQ(rows.size(), 22U);
  EXPECT_EQ(rows[0], "worst held-out views    PSNR    SSIM");
  EXPECT_EQ(rows[1], "49                      1.00   0.500");
  EXPECT_EQ(rows[20], "30                     20.00   0.500");
  EXPECT_EQ(rows[21], "mean of 50             25.50   0.500");
}

TEST(ScoreTable, IsEmptyWithoutScores) {
  EXPECT_THAT(ScoreTable(std::vector<v1::View>(3)), IsEmpty());
}

v1::View ViewOf(const std::string& name, bool held_out) {
  v1::View view;
  view.set_view(name);
  view.set_held_out(held_out);
  view.mutable_camera()->set_width(320);
  view.mutable_camera()->set_height(240);
  return view;
}

TEST(FirstCommand, ClicksInTheMiddleOfAViewTrainedOn) {
  Shell shell;
  v1::Model model;
  model.set_name("scenes/shelf/models/2");
  std::vector<v1::View> views = {ViewOf("a.jpg", true), ViewOf("b c.jpg", false)};
  EXPECT_EQ(FirstCommand(shell, model, views),
            "pepeseg segment shelf --view 'b c.jpg' --point 160,120 --views all --out masks");
  views[1].set_photograph_width(640);
  views[1].set_photograph_height(480);
  EXPECT_THAT(FirstCommand(shell, model, views), ::testing::HasSubstr("--point 320,240 "))
      << "pixels are those of the photograph";
  model.mutable_sources()->set_masks("none");
  EXPECT_EQ(FirstCommand(shell, model, views), "pepeseg export shelf shelf.ply");
}

TEST(CommandText, NamesTheProgramAsItWasCalled) {
  Shell shell;
  shell.program = "build/bin/pepeseg";
  shell.server = "127.0.0.1:7";
  EXPECT_EQ(CommandText(shell, {"train", "it's"}),
            "build/bin/pepeseg train 'it'\\''s' --server 127.0.0.1:7");
}

}  // namespace
}  // namespace pepeseg::client::cli
