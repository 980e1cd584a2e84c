#include "clients/benchmark/suite_scene.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <fstream>

#include "clients/benchmark/suite_photographs.h"
#include "clients/benchmark/suite_request.h"
#include "clients/benchmark/suite_variants.h"
#include "clients/terminal/picture.h"
#include "tests/testing/benchmark_miniatures.h"
#include "tests/testing/status_testing.h"
#include "tests/testing/temp_folder.h"

namespace pepeseg::client::cli {
namespace {

namespace fs = std::filesystem;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

absl::StatusOr<BenchmarkScene> OnlyScene(Benchmark benchmark, const fs::path& folder) {
  auto scenes = FindScenes(benchmark, folder);
  if (!scenes.ok()) return scenes.status();
  EXPECT_EQ(scenes->size(), 1u);
  return scenes->front();
}

std::string Refusal(Benchmark benchmark, const fs::path& folder) {
  const auto scenes = FindScenes(benchmark, folder);
  EXPECT_FALSE(scenes.ok());
  return std::string(scenes.status().message());
}

std::vector<std::string> Uploaded(const DatasetFolder& dataset, v1::FileKind kind) {
  std::vector<std::string> names;
  for (const FolderFile& file : dataset.files) {
    if (file.kind == kind) names.push_back(file.name);
  }
  return names;
}

v1::View ViewNamed(const std::string& name, bool held_out) {
  v1::View view;
  view.set_view(name);
  view.set_held_out(held_out);
  view.set_photograph_width(96);
  view.set_photograph_height(72);
  return view;
}

std::vector<v1::View> ViewsOfModel(const BenchmarkScene& scene) {
  const std::vector<std::string> held_out = HeldOutViews(scene);
  std::vector<v1::View> views;
  for (const std::string& name : ViewsOf(scene.dataset)) {
    views.push_back(ViewNamed(name, std::count(held_out.begin(), held_out.end(), name) > 0));
  }
  return views;
}

class BenchmarkScenes : public ::testing::Test {
 protected:
  pepeseg::testing::TempFolder folder_;
};

TEST_F(BenchmarkScenes, UploadCopiesUnderTheNamesOfTheOriginals) {
  pepeseg::testing::WriteSpinNerfMiniature(folder_.path());
  const auto scene = OnlyScene(Benchmark::kSpinNerf, folder_.path());
  ASSERT_OK(scene);
  const DatasetFolder& dataset = scene->dataset;
  EXPECT_EQ(Uploaded(dataset, v1::FILE_KIND_IMAGE).front(), "images/IMG_000.png");
  EXPECT_EQ(Uploaded(dataset, v1::FILE_KIND_IMAGE).size(), 10u);
  EXPECT_THAT(Uploaded(dataset, v1::FILE_KIND_POSES),
              ElementsAre("sparse/0/cameras.bin", "sparse/0/images.bin"));
  EXPECT_EQ(Uploaded(dataset, v1::FILE_KIND_MASK).front(), "masks/IMG_000.png");
  for (const FolderFile& file : dataset.files) {
    if (file.kind == v1::FILE_KIND_IMAGE) {
      EXPECT_THAT(file.path.string(), HasSubstr("/images_4/image"));
    }
  }
}

TEST_F(BenchmarkScenes, UsePosesBoundsWhereTheOriginalsAreMissing) {
  pepeseg::testing::WriteSpinNerfMiniature(folder_.path());
  fs::remove_all(folder_ / "table/images");
  std::ofstream(folder_ / "table/poses_bounds.npy") << "poses";
  const auto scene = OnlyScene(Benchmark::kSpinNerf, folder_.path());
  ASSERT_OK(scene);
  EXPECT_THAT(Uploaded(scene->dataset, v1::FILE_KIND_POSES), ElementsAre("poses_bounds.npy"));
  EXPECT_EQ(scene->truth[1].view, "image002.png");
}

TEST_F(BenchmarkScenes, OfSpinNerfScoreEveryAnnotatedView) {
  pepeseg::testing::WriteSpinNerfMiniature(folder_.path());
  const auto scene = OnlyScene(Benchmark::kSpinNerf, folder_.path());
  ASSERT_OK(scene);
  ASSERT_EQ(scene->truth.size(), 5u);
  EXPECT_EQ(scene->truth[1].view, "IMG_002.png");  // image002 is the third photograph by name
  ASSERT_EQ(scene->prompts.size(), 1u);
  EXPECT_EQ(scene->prompts[0].view, "IMG_000.png");
  const auto request = ScoreRequest(Benchmark::kSpinNerf, *scene, ProtocolOf(Benchmark::kSpinNerf),
                                    ViewsOfModel(*scene));
  ASSERT_OK(request);
  EXPECT_EQ(request->options().protocol(), v1::EVALUATION_PROTOCOL_LABEL_PROPAGATION);
  EXPECT_TRUE(request->options().accept_trained_views());
  EXPECT_TRUE(request->options().score_reference());
  EXPECT_EQ(request->views_size(), 5);
  EXPECT_EQ(request->own_masks_size(), 1);
}

TEST_F(BenchmarkScenes, OfNvosHoldOutTheTarget) {
  pepeseg::testing::WriteNvosMiniature(folder_.path());
  const auto scene = OnlyScene(Benchmark::kNvos, folder_.path());
  ASSERT_OK(scene);
  EXPECT_THAT(scene->held_out_views, ElementsAre("IMG_000.png", "IMG_008.png", "IMG_005.png"));
  const auto request =
      ScoreRequest(Benchmark::kNvos, *scene, ProtocolOf(Benchmark::kNvos), ViewsOfModel(*scene));
  ASSERT_OK(request);
  EXPECT_EQ(request->options().protocol(), v1::EVALUATION_PROTOCOL_PROMPTABLE);
  ASSERT_EQ(request->views_size(), 2);
  EXPECT_EQ(request->views(0).view(), "IMG_005.png");
  EXPECT_EQ(request->views(1).view(), "IMG_003.png");
  EXPECT_TRUE(request->views(1).masks().empty());
  const v1::ScribblesPrompt& scribbles = request->prompts().begin()->second.scribbles();
  EXPECT_TRUE(scribbles.has_positive());
  EXPECT_TRUE(scribbles.has_negative());
}

TEST_F(BenchmarkScenes, OfNvosMayHaveAReferenceMaskAndShareAnLlffScene) {
  pepeseg::testing::WriteNvosMiniature(folder_.path());
  for (const char* part : {"reference_image", "scribbles", "masks"}) {
    fs::rename(folder_ / part / "table", folder_ / part / "table_left");
  }
  const fs::path scribbles = folder_ / "scribbles/table_left";
  fs::rename(scribbles / "pos_0_IMG_003.png", scribbles / "mask.png");
  fs::remove(scribbles / "neg_0_IMG_003.png");
  const auto scene = OnlyScene(Benchmark::kNvos, folder_.path());
  ASSERT_OK(scene);
  EXPECT_EQ(scene->name, "table_left");
  const auto request =
      ScoreRequest(Benchmark::kNvos, *scene, ProtocolOf(Benchmark::kNvos), ViewsOfModel(*scene));
  ASSERT_OK(request);
  EXPECT_TRUE(request->prompts().begin()->second.has_mask());
}

TEST_F(BenchmarkScenes, OfLerfMaskHoldOutTheTestViews) {
  pepeseg::testing::WriteLerfMaskMiniature(folder_.path());
  const auto scene = OnlyScene(Benchmark::kLerfMaskFine, folder_.path());
  ASSERT_OK(scene);
  EXPECT_THAT(scene->held_out_views,
              ElementsAre("frame_00002.png", "frame_00005.png", "frame_00008.png"));
  const auto request = ScoreRequest(Benchmark::kLerfMaskFine, *scene,
                                    ProtocolOf(Benchmark::kLerfMaskFine), ViewsOfModel(*scene));
  ASSERT_OK(request);
  EXPECT_FALSE(request->options().accept_trained_views());
  EXPECT_EQ(request->own_masks_size(), 2);
  EXPECT_TRUE(request->own_masks().contains("red box"));
  EXPECT_EQ(request->views(0).masks_size(), 2);
}

TEST_F(BenchmarkScenes, OfOurOwnHaveSamRequestsForHeldOutViews) {
  pepeseg::testing::WriteOwnMiniature(folder_.path());
  const auto scene = OnlyScene(Benchmark::kScene, folder_.path());
  ASSERT_OK(scene);
  ASSERT_EQ(scene->levels.size(), 1u);
  const auto requests = SamRequests(*scene, ViewsOfModel(*scene));
  ASSERT_OK(requests);
  ASSERT_EQ(requests->size(), 2u);  // views 0 and 8
  EXPECT_EQ((*requests)[0].sam_views(0).masks_size(), 3);
  EXPECT_EQ((*requests)[0].sam_views(0).masks(0).predicted_iou(), 0.95);
}

// Replaces the label images of our own miniature by outlines of these photographs.
void WriteOutlines(const fs::path& scene, const std::vector<std::string>& stems) {
  fs::remove_all(scene / "labels");
  fs::create_directories(scene / "labels");
  for (const std::string& stem : stems) {
    std::ofstream(scene / "labels" / (stem + ".json"))
        << R"({"imageWidth": 96, "imageHeight": 72, "shapes": [{"label": "ball", "points": )"
        << R"([[10, 10], [60, 10], [60, 50]]}]})";
  }
}

TEST_F(BenchmarkScenes, OfOurOwnHoldOutAFewOutlinedPhotographs) {
  pepeseg::testing::WriteOwnMiniature(folder_.path());
  WriteOutlines(folder_.path(), {"003", "006"});
  const auto few = OnlyScene(Benchmark::kScene, folder_.path());
  ASSERT_OK(few);
  EXPECT_THAT(HeldOutViews(*few), ElementsAre("003.png", "006.png"));
  WriteOutlines(folder_.path(), {"003", "006", "008"});
  const auto many = OnlyScene(Benchmark::kScene, folder_.path());
  ASSERT_OK(many);
  EXPECT_THAT(HeldOutViews(*many), ElementsAre("000.png", "008.png"));
  WriteOutlines(folder_.path(), {"003", "006", "007"});
  EXPECT_THAT(Refusal(Benchmark::kScene, folder_.path()),
              HasSubstr("outlines of 3 photographs, but of none that is held out: 000.png, "
                        "008.png; outline these"));
}

TEST_F(BenchmarkScenes, OfOurOwnAreRefusedWithOutlinesOfUnknownPhotographs) {
  pepeseg::testing::WriteOwnMiniature(folder_.path());
  WriteOutlines(folder_.path(), {"033"});
  EXPECT_THAT(Refusal(Benchmark::kScene, folder_.path()),
              HasSubstr("033.json: no photograph \"033\" among the 10 of "));
}

TEST_F(BenchmarkScenes, ResampleMasksOfAnotherSizeAndRefuseOtherShapes) {
  pepeseg::testing::WriteSpinNerfMiniature(folder_.path());
  const fs::path mask = folder_ / "table/object_masks/image002.png";
  ASSERT_OK(WritePng(mask, GreyPicture{192, 144, std::vector<uint8_t>(192 * 144, 1)}));
  const auto scene = OnlyScene(Benchmark::kSpinNerf, folder_.path());
  ASSERT_OK(scene);
  const auto protocol = v1::EVALUATION_PROTOCOL_LABEL_PROPAGATION;
  const auto request = ScoreRequest(Benchmark::kSpinNerf, *scene, protocol, ViewsOfModel(*scene));
  ASSERT_OK(request);
  EXPECT_EQ(request->views(1).masks(0).mask().png(),
            EncodePng({96, 72, std::vector<uint8_t>(96 * 72, 255)}));
  ASSERT_OK(WritePng(mask, GreyPicture{72, 96, std::vector<uint8_t>(72 * 96, 1)}));
  EXPECT_THAT(ScoreRequest(Benchmark::kSpinNerf, *scene, protocol, ViewsOfModel(*scene))
                  .status()
                  .ToString(),
              HasSubstr("72x96 pixels, which is not the shape of the photograph, 96x72"));
}

TEST_F(BenchmarkScenes, AreRefusedWithWhatWasLookedForWhere) {
  EXPECT_THAT(Refusal(Benchmark::kNvos, folder_.path()),
              HasSubstr("not the layout of nvos: looked for masks/SCENE/TARGET_mask.png"));
  EXPECT_THAT(Refusal(Benchmark::kSpinNerf, folder_.path()), HasSubstr("SCENE/object_masks/"));
  EXPECT_THAT(Refusal(Benchmark::kLerfMask, folder_.path()),
              HasSubstr("SCENE/test_mask/VIEW/PROMPT.png"));
  EXPECT_THAT(Refusal(Benchmark::kScene, folder_.path()), HasSubstr("images/, or SCENE/images/"));
}

TEST_F(BenchmarkScenes, AreRefusedWithThePartThatIsMissing) {
  pepeseg::testing::WriteNvosMiniature(folder_.path());
  fs::remove_all(folder_ / "scribbles");
  EXPECT_THAT(Refusal(Benchmark::kNvos, folder_.path()), HasSubstr("looked for pos_*.png"));
  fs::remove_all(folder_ / "table/sparse");
  EXPECT_THAT(Refusal(Benchmark::kNvos, folder_.path()),
              HasSubstr("no poses: looked for sparse/0/ and poses_bounds.npy"));
  fs::remove_all(folder_ / "table");
  EXPECT_THAT(Refusal(Benchmark::kNvos, folder_.path()),
              HasSubstr("no LLFF scene of table: looked for the folders"));
}

TEST_F(BenchmarkScenes, AreRefusedWithMasksOfUnknownViews) {
  pepeseg::testing::WriteLerfMaskMiniature(folder_.path());
  fs::rename(folder_ / "table/test_mask/frame_00002", folder_ / "table/test_mask/frame_00022");
  EXPECT_THAT(Refusal(Benchmark::kLerfMask, folder_.path()),
              HasSubstr("no photograph \"frame_00022\" among the 10"));
}

TEST_F(BenchmarkScenes, AreChosenByName) {
  pepeseg::testing::WriteLerfMaskMiniature(folder_.path());
  const auto scenes = FindScenes(Benchmark::kLerfMask, folder_.path(), {{"chair"}, ""});
  EXPECT_THAT(scenes.status().ToString(), HasSubstr("no scene \"chair\"; it has table"));
}

TEST_F(BenchmarkScenes, AreThinnedOutForRobustness) {
  pepeseg::testing::WriteOwnMiniature(folder_.path());
  const auto scene = OnlyScene(Benchmark::kScene, folder_.path());
  ASSERT_OK(scene);
  const std::vector<BenchmarkVariant> variants = RobustnessVariants();
  const auto quarter = DatasetOf(variants[1], *scene, folder_ / "out");
  ASSERT_OK(quarter);
  // The held-out views 0 and 8, and of the eight others the first and the fifth.
  EXPECT_THAT(ViewsOf(*quarter), ElementsAre("000.png", "001.png", "005.png", "008.png"));
  const auto fewer = DatasetOf(variants[2], *scene, folder_ / "out");
  ASSERT_OK(fewer);
  ASSERT_EQ(fewer->files.size(), scene->dataset.files.size());
  BenchmarkScene thinned = *scene;
  thinned.folder = folder_ / "out" / scene->name;
  const auto requests = SamRequests(thinned, {ViewNamed("000.png", true)});
  ASSERT_OK(requests);
  EXPECT_EQ((*requests)[0].sam_views(0).masks_size(), 2);
}

}  // namespace
}  // namespace pepeseg::client::cli
