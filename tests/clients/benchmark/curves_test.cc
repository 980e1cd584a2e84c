#include "clients/benchmark/curves.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>

#include "clients/benchmark/evaluation_truth.h"
#include "clients/cpp/mask.h"
#include "tests/clients/benchmark/label_me_file.h"
#include "tests/testing/status_testing.h"
#include "tests/testing/temp_folder.h"

namespace pepeseg::client::cli {
namespace {

namespace fs = std::filesystem;

v1::View HeldOut(const std::string& name, int width, int height) {
  v1::View view;
  view.set_view(name);
  view.set_held_out(true);
  view.mutable_camera()->set_width(width);
  view.mutable_camera()->set_height(height);
  return view;
}

void WriteLabels(const fs::path& path, int width, int height, uint8_t id) {
  fs::create_directories(path.parent_path());
  const std::vector<uint8_t> pixels(static_cast<size_t>(width) * height, id);
  ASSERT_OK(WritePng(path, GreyPicture{width, height, pixels}));
}

TEST(EvaluateRequestOf, DrawsOutlinesInTheSizeOfThePhotograph) {
  const testing::TempFolder folder;
  testing::WriteLabelMe(folder.path() / "labels/a.json");
  const auto levels = FindTruth(folder.path());
  ASSERT_OK(levels);
  const auto request = EvaluateRequestOf(folder.path(), (*levels)[0], "m",
                                         {HeldOut("a.jpg", 4, 3), HeldOut("b.jpg", 4, 3)});
  ASSERT_OK(request);
  ASSERT_EQ(request->views_size(), 1);
  EXPECT_TRUE(request->views(0).labels_png().empty());
  ASSERT_EQ(request->views(0).masks_size(), 1);
  EXPECT_EQ(request->views(0).masks(0).entity(), "cup");
  const auto mask = DecodeRle(request->views(0).masks(0).mask().rle());
  ASSERT_OK(mask);
  EXPECT_THAT(*mask, ::testing::ElementsAre(0, 0, 0, 0, 0, 1, 0, 0, 0, 0, 0, 0));
  const auto other = EvaluateRequestOf(folder.path(), (*levels)[0], "m", {HeldOut("a.jpg", 4, 8)});
  EXPECT_THAT(std::string(other.status().message()),
              ::testing::HasSubstr("a.json: 8x6 pixels, which is not the shape of the photograph"));
}

// As of photographs on their side: the server knows their EXIF orientation.
TEST(EvaluateRequestOf, LeavesLabelsOfTheStoredPixelsOnTheirSide) {
  const testing::TempFolder folder;
  WriteLabels(folder.path() / "labels/a.png", 8, 4, 3);
  const TruthLevel level{"labels", folder.path() / "labels", {{3, "cup"}}};
  const auto request = EvaluateRequestOf(folder.path(), level, "m", {HeldOut("a.jpg", 8, 16)});
  ASSERT_OK(request);
  EXPECT_EQ(request->views(0).labels_png(), EncodePng({16, 8, std::vector<uint8_t>(128, 3)}));
}

TEST(EvaluateRequestOf, ResizesLabelsToTheirViews) {
  const testing::TempFolder folder;
  WriteLabels(folder.path() / "labels/a.png", 8, 6, 3);
  v1::View trained = HeldOut("c.jpg", 4, 3);
  trained.set_held_out(false);
  const std::vector<v1::View> views = {HeldOut("a.jpg", 4, 3), HeldOut("b.jpg", 4, 3), trained};
  const TruthLevel level{"labels", folder.path() / "labels", {{3, "cup"}}};
  const auto request = EvaluateRequestOf(folder.path(), level, "scenes/s/models/1", views);
  ASSERT_OK(request);
  ASSERT_EQ(request->views_size(), 1);
  EXPECT_EQ(request->views(0).view(), "a.jpg");
  EXPECT_EQ(request->views(0).labels_png(), EncodePng({4, 3, std::vector<uint8_t>(12, 3)}));
  EXPECT_TRUE(request->views(0).ignore_png().empty());
  EXPECT_EQ(request->entity_names().at(3), "cup");
}

TEST(EvaluateRequestOf, KeepsLabelsOfThePhotographsSize) {
  const testing::TempFolder folder;
  WriteLabels(folder.path() / "labels/a.png", 8, 6, 3);
  v1::View view = HeldOut("a.jpg", 4, 3);
  view.set_photograph_width(8);
  view.set_photograph_height(6);
  const TruthLevel level{"labels", folder.path() / "labels", {}};
  const auto request = EvaluateRequestOf(folder.path(), level, "m", {view});
  ASSERT_OK(request);
  EXPECT_EQ(request->frame(), v1::PIXEL_FRAME_PHOTOGRAPH);
  EXPECT_EQ(request->views(0).labels_png(), EncodePng({8, 6, std::vector<uint8_t>(48, 3)}));
}

TEST(EvaluateRequestOf, RefusesLabelsOfAnotherShape) {
  const testing::TempFolder folder;
  WriteLabels(folder.path() / "labels/a.png", 8, 3, 3);
  const TruthLevel level{"labels", folder.path() / "labels", {}};
  const auto request = EvaluateRequestOf(folder.path(), level, "m", {HeldOut("a.jpg", 4, 3)});
  EXPECT_EQ(request.status().code(), absl::StatusCode::kInvalidArgument);
  EXPECT_THAT(std::string(request.status().message()), ::testing::HasSubstr("8x3"));
}

BenchRun MakeRun() {
  BenchRun run;
  run.name = "preview";
  run.seed = 2;
  run.job.mutable_effective_options()->set_preset(v1::TRAINING_PRESET_PREVIEW);
  run.model.set_device("cpu (2 threads)");
  run.model.set_num_gaussians(1234);
  auto& metrics = *run.model.mutable_metrics();
  metrics["psnr"] = 30.5;
  metrics["seconds_prepare"] = 1;
  metrics["seconds_reconstruct"] = 10;
  metrics["core_seconds_reconstruct"] = 19;
  metrics["seconds_features"] = 5;
  run.seconds = {{"queue", 0.5}, {"request_to_model", 17}, {"first_click", 2}, {"next_click", 0.1}};
  run.steps = {{"reconstruct", 900}};
  v1::EvaluateModelResponse scores;
  scores.mutable_scene()->mutable_reference()->set_iou(0.75);
  scores.add_entities();
  run.levels.emplace_back("part", scores);
  return run;
}

TEST(BenchRecord, HasTimesThatAddUpToTheFirstClick) {
  BenchRecord record;
  record.dataset = "desk";
  record.facts["commit"] = "abc";
  record.upload_seconds = 3;
  record.runs = {MakeRun()};
  const auto json = ToJson(record);
  EXPECT_EQ(json["dataset"], "desk");
  EXPECT_EQ(json["commit"], "abc");
  EXPECT_EQ(json["device"], "cpu (2 threads)");
  EXPECT_EQ(json["options"]["preview"]["preset"], "TRAINING_PRESET_PREVIEW");
  const auto& run = json["runs"][0];
  EXPECT_DOUBLE_EQ(run["seconds"]["request_to_click"].get<double>(), 3 + 17 + 2);
  EXPECT_DOUBLE_EQ(run["seconds"]["between"].get<double>(), 17 - 0.5 - 1 - 10 - 5);
  EXPECT_DOUBLE_EQ(run["core_seconds"]["reconstruct"].get<double>(), 19);
  EXPECT_EQ(run["steps"]["reconstruct"], 900);
  EXPECT_EQ(run["levels"]["part"]["miou"], 0.75);
  EXPECT_EQ(run["levels"]["part"]["entities"], 1);
}

TEST(BenchRecord, HasNoTimeToAClickThatWasNotMade) {
  BenchRun run = MakeRun();
  run.seconds.erase("first_click");
  run.seconds.erase("next_click");
  BenchRecord record;
  record.runs = {run};
  EXPECT_FALSE(ToJson(record)["runs"][0]["seconds"].contains("request_to_click"));
  EXPECT_THAT(RunLine(run), ::testing::HasSubstr("preview, seed 2: 17.0 s, 30.50 dB"));
}

}  // namespace
}  // namespace pepeseg::client::cli
