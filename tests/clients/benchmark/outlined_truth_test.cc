#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>

#include "clients/benchmark/evaluate.h"
#include "clients/benchmark/evaluation_truth.h"
#include "clients/cpp/mask.h"
#include "clients/terminal/picture.h"
#include "tests/testing/status_testing.h"
#include "tests/testing/temp_folder.h"

// Outlines, and what a scene's folder has, as the truth of an evaluation.
namespace pepeseg::client::cli {
namespace {

namespace fs = std::filesystem;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

// Two held-out views, and outlines in an empty folder. The photographs have 8 x 4 pixels, the views
// that are trained on 4 x 2.
struct OutlinedTruth : ::testing::Test {
  OutlinedTruth() {
    flags.folder = folder / "outlined";
    for (const char* name : {"a.jpg", "b.jpg"}) {
      v1::View& view = views.emplace_back();
      view.set_view(name);
      view.set_held_out(true);
      view.set_photograph_width(8);
      view.set_photograph_height(4);
      view.mutable_camera()->set_width(4);
      view.mutable_camera()->set_height(2);
    }
  }
  // Writes a file of COCO: a cup, the first column, in a photograph of these pixels.
  void Write(const std::string& file, const std::string& photograph, int width, int height) const {
    fs::create_directories((folder / file).parent_path());
    std::ofstream(folder / file)
        << R"({"categories": [{"id": 5, "name": "cup"}], "images": [{"id": 1, "file_name": ")"
        << photograph << R"(", "width": )" << width << R"(, "height": )" << height
        << R"(}], "annotations": [{"image_id": 1, "category_id": 5, "segmentation": {"size": [)"
        << height << "," << width << R"(], "counts": [0, )" << height << ", "
        << height * (width - 1) << "]}}]}";
  }
  // Returns the pixels of the only mask that AddTruth adds, or its error.
  std::string Added() {
    request.clear_views();
    const auto added = AddTruth(flags, views, request);
    if (!added.ok()) return std::string(added.status().message());
    if (request.views_size() != 1 || request.views(0).masks_size() != 1) return "not one mask";
    const auto mask = DecodeRle(request.views(0).masks(0).mask().rle());
    std::string pixels = request.views(0).view() + " " + request.views(0).masks(0).entity() + " ";
    for (const uint8_t pixel : *mask) pixels += pixel != 0 ? '#' : '.';
    return pixels;
  }

  testing::TempFolder folder;
  TruthFlags flags;
  std::vector<v1::View> views;
  v1::EvaluateModelRequest request;
};

TEST_F(OutlinedTruth, IsDrawnInTheSizeOfThePhotographWithTheIgnoreMask) {
  flags.ignore = folder / "ignore";
  fs::create_directories(flags.ignore);
  std::ofstream(folder / "ignore/a.png") << "ignored";
  Write("outlined/coco.json", "a.png", 4, 2);
  EXPECT_EQ(Added(), "a.jpg cup ##......##......##......##......");
  EXPECT_EQ(request.views(0).ignore_png(), "ignored");
  request.clear_views();
  const auto added = AddTruth(flags, views, request);
  ASSERT_OK(added);
  EXPECT_THAT(added->views_without, ElementsAre("b.jpg"));
  EXPECT_EQ(added->outlines.size(), 1u);
}

TEST_F(OutlinedTruth, GivesItsEntitiesToAReference) {
  Write("outlined/coco.json", "a.png", 8, 4);
  ASSERT_OK(AddTruth(flags, views, request));
  ASSERT_OK(AddEntityPrompts({.reference = "a.jpg"}, flags, request));
  ASSERT_EQ(request.own_masks_size(), 1);
  EXPECT_EQ(request.own_masks().begin()->first, "cup");
}

TEST_F(OutlinedTruth, MayBeAFileOrInASceneBelowItsLabelImages) {
  Write("scene/annotations/a.json", "a.jpg", 8, 4);
  const std::string cup = "a.jpg cup #.......#.......#.......#.......";
  for (const char* path : {"scene/annotations/a.json", "scene/annotations", "scene"}) {
    flags.folder = folder / path;
    EXPECT_EQ(Added(), cup) << path;
  }
  fs::create_directories(folder / "scene/labels");
  ASSERT_OK(WritePng(folder / "scene/labels/b.png", GreyPicture{2, 1, {3, 7}}));
  request.clear_views();
  const auto added = AddTruth(flags, views, request);
  ASSERT_OK(added);
  EXPECT_THAT(added->outlines, ::testing::IsEmpty());
  ASSERT_EQ(request.views_size(), 1);
  EXPECT_EQ(request.views(0).labels_png(), EncodePng({2, 1, {3, 7}}));
}

TEST_F(OutlinedTruth, IsNotReadWhereAViewHasALabelImage) {
  Write("outlined/a.json", "a.jpg", 8, 4);
  ASSERT_OK(WritePng(folder / "outlined/b.png", GreyPicture{2, 1, {3, 7}}));
  const auto added = AddTruth(flags, views, request);
  ASSERT_OK(added);
  EXPECT_THAT(added->views_without, ElementsAre("a.jpg"));
  views.pop_back();
  request.clear_views();
  EXPECT_THAT(Added(), HasSubstr("expected a.png or masks in a/, or outlines")) << "of other views";
}

// As of a photograph that lies on its side: the server knows its EXIF orientation.
TEST_F(OutlinedTruth, IsDrawnInTheStoredPixelsIfOnlyTheseHaveItsShape) {
  Write("outlined/coco.json", "a.jpg", 2, 4);
  EXPECT_EQ(Added(), "a.jpg cup ##..##..##..##..##..##..##..##..");
  EXPECT_EQ(request.views(0).masks(0).mask().rle().width(), 4);
  EXPECT_EQ(request.views(0).masks(0).mask().rle().height(), 8);
}

TEST_F(OutlinedTruth, IsRefusedInAnotherShapeAndForAnotherFrame) {
  Write("outlined/coco.json", "a.jpg", 4, 4);
  EXPECT_THAT(Added(), HasSubstr("coco.json: 4x4 pixels, which is not the shape of the photograph, "
                                 "8x4"));
  request.set_frame(v1::PIXEL_FRAME_VIEW);
  Write("outlined/coco.json", "a.jpg", 8, 4);
  EXPECT_THAT(Added(),
              HasSubstr("coco.json: outlines of \"a.jpg\" on 8x4 pixels; the view that was "
                        "trained on has 4x2: leave out --frame view"));
  Write("outlined/coco.json", "a.jpg", 4, 2);
  EXPECT_EQ(Added(), "a.jpg cup #...#...");
}

TEST_F(OutlinedTruth, IsRefusedIfMalformedOrOfNoViewToScore) {
  Write("outlined/coco.json", "a.jpg", 8, 4);
  std::ofstream(folder / "outlined/other.json") << "[1]";
  EXPECT_THAT(Added(), HasSubstr("other.json: neither outlines of LabelMe"));
  fs::remove(folder / "outlined/other.json");
  Write("outlined/coco.json", "aa.jpg", 8, 4);
  const auto none = AddTruth(flags, views, request);
  EXPECT_TRUE(absl::IsNotFound(none.status()));
  EXPECT_THAT(
      std::string(none.status().message()),
      HasSubstr("outlined has nothing of a view to score: expected outlines of a.jpg; found "
                "those of 1 other photographs, such as \"aa.jpg\""));
}

TEST_F(OutlinedTruth, OfUnknownPhotographsIsNamed) {
  std::vector<OutlinedPhotograph> outlines(3);
  outlines[0].name = "b";
  outlines[1] = {"images/aa.png", "coco.json", {}, {}};
  outlines[2].name = "c";
  EXPECT_EQ(UnknownPhotographs(outlines, views),
            "2 of 3 photographs with outlines are not views of the model, such as "
            "\"images/aa.png\" of coco.json");
  outlines[1].name = "aa";
  EXPECT_THAT(UnknownPhotographs(outlines, views), HasSubstr("; did you mean a.jpg"));
  outlines.resize(1);
  EXPECT_EQ(UnknownPhotographs(outlines, views), "");
}

TEST_F(OutlinedTruth, IsOfOneLevel) {
  fs::create_directories(folder / "outlined/gt/part");
  ASSERT_OK(WritePng(folder / "outlined/gt/part/a.png", GreyPicture{2, 1, {1, 0}}));
  std::ofstream(folder / "outlined/gt/labels.json") << R"({"part": ["-", "leg"]})";
  (*request.mutable_entity_names())[0] = "given";
  ASSERT_OK(AddTruth(flags, views, request));
  EXPECT_EQ(request.views(0).view(), "a.jpg");
  EXPECT_EQ(request.entity_names().at(1), "leg");
  EXPECT_EQ(request.entity_names().at(0), "given");
  std::ofstream(folder / "outlined/gt/labels.json") << R"({"part": [], "object": []})";
  EXPECT_THAT(Added(), HasSubstr("gt/labels.json has 2 levels; give the folder of one, such as "));
}

}  // namespace
}  // namespace pepeseg::client::cli
