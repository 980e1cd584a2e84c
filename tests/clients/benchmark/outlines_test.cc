#include "clients/benchmark/outlines.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>
#include <numeric>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "clients/benchmark/outline_files.h"
#include "clients/cpp/mask.h"
#include "tests/testing/status_testing.h"
#include "tests/testing/temp_folder.h"

namespace pepeseg::client::cli {
namespace {

namespace fs = std::filesystem;
using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

// Returns the scanlines of a mask, '#' inside and '.' outside.
std::vector<std::string> Scanlines(const GreyPicture& mask) {
  std::vector<std::string> lines;
  for (int y = 0; y < mask.height; ++y) {
    std::string& line = lines.emplace_back();
    for (int x = 0; x < mask.width; ++x) {
      line += mask.pixels[static_cast<size_t>(y) * mask.width + x] != 0 ? '#' : '.';
    }
  }
  return lines;
}

std::vector<OutlinePoint> Square(double left, double top, double right, double bottom) {
  return {{left, top}, {right, top}, {right, bottom}, {left, bottom}};
}

OutlinedEntity Entity(std::vector<std::vector<OutlinePoint>> polygons) {
  return {"thing", {{std::move(polygons), {}}}};
}

TEST(MaskOfEntity, HasThePixelsWithTheirCentresInside) {
  // The left and top borders are inside, the right and bottom ones outside.
  EXPECT_THAT(Scanlines(MaskOfEntity(Entity({Square(0.5, 1, 2.5, 3)}), {4, 4}, {4, 4})),
              ElementsAre("....", "##..", "##..", "...."));
  EXPECT_THAT(Scanlines(MaskOfEntity(Entity({{{0, 0}, {4, 0}, {0, 4}}}), {4, 4}, {4, 4})),
              ElementsAre("###.", "##..", "#...", "...."));
}

// As COCO's own code has it: strokes that overlap leave no hole.
TEST(MaskOfEntity, UnitesPolygonsThatOverlap) {
  const OutlinedEntity strokes =
      Entity({Square(0, 0, 3, 2), Square(2, 0, 5, 2), Square(1, 1, 2, 4)});
  EXPECT_THAT(Scanlines(MaskOfEntity(strokes, {5, 4}, {5, 4})),
              ElementsAre("#####", "#####", ".#...", ".#..."));
  const OutlinedEntity twice = Entity({Square(0, 0, 2, 2), Square(0, 0, 2, 2)});
  EXPECT_THAT(Scanlines(MaskOfEntity(twice, {3, 2}, {3, 2})), ElementsAre("##.", "##."));
  const OutlinedEntity everything = Entity({Square(0, 0, 3, 2), Square(0, 0, 3, 2)});
  EXPECT_THAT(Scanlines(MaskOfEntity(everything, {3, 2}, {3, 2})), ElementsAre("###", "###"));
}

// The right part of a thing may lie wholly in its left part: it shares the thing's border.
TEST(MaskOfEntity, HasNoHoleWhereAStrokeTouchesTheBorderOfAnother) {
  const OutlinedEntity strokes = Entity({Square(0, 0, 5, 4), Square(1, 0, 3, 2)});
  EXPECT_THAT(Scanlines(MaskOfEntity(strokes, {5, 5}, {5, 5})),
              ElementsAre("#####", "#####", "#####", "#####", "....."));
  const OutlinedEntity at_the_left = Entity({Square(1, 0, 5, 5), Square(1, 1, 3, 3)});
  EXPECT_THAT(Scanlines(MaskOfEntity(at_the_left, {5, 5}, {5, 5})),
              ElementsAre(".####", ".####", ".####", ".####", ".####"));
}

TEST(MaskOfEntity, HasAHoleWhereAPolygonLiesInsideAnother) {
  OutlinedEntity ring = Entity({Square(0, 0, 5, 5), Square(1, 1, 4, 4), Square(2, 2, 3, 3)});
  EXPECT_THAT(Scanlines(MaskOfEntity(ring, {5, 5}, {5, 5})),
              ElementsAre("#####", "#...#", "#.#.#", "#...#", "#####"));
  ring.regions.push_back({{Square(1, 0, 2, 5)}, {}});
  EXPECT_THAT(Scanlines(MaskOfEntity(ring, {5, 5}, {5, 5})),
              ElementsAre("#####", "##..#", "###.#", "##..#", "#####"));
}

TEST(MaskOfEntity, CutsWhatIsOutsideTheImage) {
  EXPECT_THAT(Scanlines(MaskOfEntity(Entity({Square(-900, -1e6, 1.5, 1e6)}), {3, 2}, {3, 2})),
              ElementsAre("#..", "#.."));
  EXPECT_THAT(Scanlines(MaskOfEntity(Entity({Square(5, 5, 9, 9)}), {3, 2}, {3, 2})),
              ElementsAre("...", "..."));
}

TEST(MaskOfEntity, IsDrawnInTheSizeOfThePhotograph) {
  EXPECT_THAT(Scanlines(MaskOfEntity(Entity({Square(1, 0, 2, 1)}), {2, 2}, {4, 4})),
              ElementsAre("..##", "..##", "....", "...."));
  const std::vector<uint8_t> corner = {0, 1, 0, 0};
  OutlinedEntity entity;
  entity.regions.push_back({{}, EncodeRle(corner, 2, 2)});
  EXPECT_THAT(Scanlines(MaskOfEntity(entity, {2, 2}, {4, 4})),
              ElementsAre("..##", "..##", "....", "...."));
}

TEST(OutlinesOf, FindsAPhotographWithAndWithoutFolderAndEnding) {
  std::vector<OutlinedPhotograph> photographs(2);
  photographs[0].name = "images/left/a.png";
  photographs[1].name = "a";
  EXPECT_EQ(OutlinesOf(photographs, "left/a.jpg"), &photographs[0]);
  EXPECT_EQ(OutlinesOf(photographs, "a.jpg"), &photographs[1]);
  EXPECT_EQ(OutlinesOf(photographs, "right/a.jpg"), nullptr);
}

class OutlineFiles : public ::testing::Test {
 protected:
  void Write(const std::string& name, const std::string& text) {
    fs::create_directories((folder_ / name).parent_path());
    std::ofstream(folder_ / name) << text;
  }

  // Writes a file of LabelMe with these shapes.
  void WriteShapes(const std::string& name, const std::vector<std::string>& shapes) {
    Write(name, absl::StrCat(R"({"version": "5.5.0", "flags": {}, "imagePath": "x.jpg", )"
                             R"("imageData": null, "imageWidth": 8, "imageHeight": 4, "shapes": [)",
                             absl::StrJoin(shapes, ","), "]}"));
  }

  // Writes a file of COCO with one image of 8 x 4 pixels, "a.jpg", and these annotations.
  void WriteAnnotations(const std::vector<std::string>& annotations) {
    Write("coco.json",
          absl::StrCat(R"({"images": [{"id": 7, "file_name": "a.jpg", "width": 8, "height": 4}],)",
                       R"("categories": [{"id": 1, "name": "mug"}, {"id": 2, "name": "lid"}],)",
                       R"("annotations": [)", absl::StrJoin(annotations, ","), "]}"));
  }

  std::vector<OutlinedPhotograph> Read() {
    auto photographs = ReadOutlines(folder_.path(), /*refuse_others=*/true);
    EXPECT_OK(photographs);
    return photographs.ok() ? *photographs : std::vector<OutlinedPhotograph>();
  }

  std::string Refusal() {
    const auto photographs = ReadOutlines(folder_.path(), /*refuse_others=*/true);
    EXPECT_EQ(photographs.status().code(), absl::StatusCode::kInvalidArgument);
    return std::string(photographs.status().message());
  }

  // Reads the entities of the only photograph, "NAME PIXELS" each.
  std::vector<std::string> NamesAndAreas() {
    std::vector<std::string> texts;
    const std::vector<OutlinedPhotograph> photographs = Read();
    EXPECT_EQ(photographs.size(), 1u);
    for (const OutlinedPhotograph& photograph : photographs) {
      for (const OutlinedEntity& entity : photograph.entities) {
        const auto mask = MaskOfEntity(entity, photograph.size, photograph.size).pixels;
        texts.push_back(
            absl::StrCat(entity.name, " ", std::accumulate(mask.begin(), mask.end(), 0)));
      }
    }
    return texts;
  }

  pepeseg::testing::TempFolder folder_;
};

// A square of LabelMe with a side of 2 pixels.
std::string Shape(const std::string& label, const std::string& group, int left) {
  return absl::StrCat(R"({"label": ")", label, R"(", "group_id": )", group,
                      R"(, "shape_type": "polygon", "flags": {}, "points": [[)", left, ",0],[",
                      left + 2, ",0],[", left + 2, ",2],[", left, ",2]]}");
}

// An annotation of COCO.
std::string Annotation(int category, const std::string& segmentation,
                       const std::string& more = "") {
  return absl::StrCat(R"({"id": 1, "image_id": 7, "iscrowd": 0, "category_id": )", category,
                      R"(, "segmentation": )", segmentation, more, "}");
}
constexpr char kSquare[] = "[[0,0,2,0,2,2,0,2]]";
constexpr char kOtherSquare[] = "[[4,0,6,0,6,2,4,2]]";

TEST_F(OutlineFiles, OfLabelMeAreNamedAfterTheirPhotographs) {
  WriteShapes("left/a.json", {Shape("mug", "null", 0)});
  WriteShapes("b.json", {Shape("mug", "null", 0)});
  WriteShapes("without_shapes.json", {});
  const std::vector<OutlinedPhotograph> photographs = Read();
  ASSERT_EQ(photographs.size(), 2u);
  EXPECT_EQ(photographs[0].name, "b");
  EXPECT_EQ(photographs[1].name, "left/a");
  EXPECT_EQ(photographs[1].file, folder_ / "left/a.json");
  EXPECT_EQ(photographs[1].size, (PixelSize{8, 4}));
}

TEST_F(OutlineFiles, OfLabelMeHaveAnEntityForEachLabelAndGroup) {
  WriteShapes("a.json", {Shape("mug", "1", 0), Shape("mug", "2", 2), Shape("mug", "1", 4),
                         Shape("lid", "1", 0), Shape("tray", "null", 1)});
  EXPECT_THAT(NamesAndAreas(), ElementsAre("mug.1 8", "mug.2 4", "lid.1 4", "tray 4"));
}

TEST_F(OutlineFiles, OfLabelMeMayHaveRectanglesAndCircles) {
  WriteShapes("a.json",
              {R"({"label": "box", "shape_type": "rectangle", "points": [[5, 3], [2, 1]]})",
               R"({"label": "ball", "shape_type": "circle", "points": [[4, 2], [4, 3.6]]})"});
  // A circle of radius 1.6 has the 12 of 16 pixels around its centre that are no corners.
  EXPECT_THAT(NamesAndAreas(), ElementsAre("box 6", "ball 12"));
}

TEST_F(OutlineFiles, OfLabelMeAreRefusedIfTwoThingsLookAlike) {
  WriteShapes("a.json",
              {Shape("mug", "null", 0), Shape("lid", "null", 0), Shape("mug", "null", 4)});
  EXPECT_THAT(Refusal(), AllOf(HasSubstr("a.json: shapes 0 and 2 are both \"mug\" and have no "
                                         "group_id: give each thing a number"),
                               HasSubstr(folder_.path().string())));
}

TEST_F(OutlineFiles, OfLabelMeAreRefusedWithTheShapeAndTheRemedy) {
  for (const auto& [shape, message] : std::vector<std::pair<std::string, std::string>>{
           {R"({"label": "mug", "shape_type": "line", "points": [[0, 0], [1, 1]]})",
            "shape 1: shape_type \"line\" is not read; draw a polygon"},
           {R"({"label": "mug", "shape_type": "polygon", "points": [[0, 0], [1, 1]]})",
            "shape 1: a polygon of 2 points: at least 3 are needed"},
           {R"({"label": "mug", "shape_type": "circle", "points": [[0, 0]]})",
            "shape 1: a circle of 1 points: expected 2"},
           {R"({"label": "mug", "points": [[0, 0], [1, "x"], [1, 1]]})",
            "shape 1: point 1 is [1,\"x\"]: expected [x, y]"},
           {R"({"label": "mug", "points": [[0, 0], [1, 1e300], [1, 1]]})",
            "shape 1: point 1 is [1,1e+300]: expected [x, y]"},
           {R"({"label": "mug", "points": 5})", "shape 1: points is 5: expected [[x, y], ...]"},
           {R"({"label": "", "points": [[0, 0], [1, 0], [1, 1]]})",
            "shape 1: the label is \"\": expected the name of a thing"},
           {R"({"label": "mug", "group_id": [], "points": [[0, 0], [1, 0], [1, 1]]})",
            "shape 1: the instance is []: expected a number or null"},
           {"3", "shape 1: points is null"}}) {
    WriteShapes("a.json", {Shape("lid", "null", 0), shape});
    EXPECT_THAT(Refusal(), HasSubstr("a.json: " + message)) << shape;
  }
  Write("a.json", R"({"shapes": [], "imageWidth": 8})");
  EXPECT_THAT(Refusal(), HasSubstr("a.json: imageHeight is null: expected the size of the image"));
  Write("a.json", R"({"shapes": {}, "imageWidth": 8, "imageHeight": 8})");
  EXPECT_THAT(Refusal(), HasSubstr("a.json: shapes is {}: expected a list"));
}

TEST_F(OutlineFiles, OfCocoHaveHolesAndRunLengths) {
  WriteAnnotations({Annotation(1, "[[0,0,4,0,4,4,0,4],[1,1,3,1,3,3,1,3]]"),
                    Annotation(2, R"({"size": [4, 8], "counts": [5, 3, 24]})")});
  EXPECT_THAT(NamesAndAreas(), ElementsAre("mug 12", "lid 3"));
  const std::vector<uint8_t> all(32, 1);
  const std::string counts = EncodeRle(all, 8, 4).counts();
  WriteAnnotations({Annotation(1, absl::StrCat(R"({"size": [4, 8], "counts": ")", counts, "\"}"))});
  EXPECT_THAT(NamesAndAreas(), ElementsAre("mug 32"));
}

TEST_F(OutlineFiles, OfCocoHaveAnEntityForEachCategoryAndInstance) {
  WriteAnnotations({Annotation(1, kSquare, R"(, "track_id": 4)"),
                    Annotation(1, kOtherSquare, R"(, "attributes": {"track_id": 5})"),
                    Annotation(1, kOtherSquare, R"(, "instance_id": 4)"),
                    Annotation(2, kSquare, R"(, "attributes": {"occluded": false})")});
  EXPECT_THAT(NamesAndAreas(), ElementsAre("mug.4 8", "mug.5 4", "lid 4"));
  WriteAnnotations({Annotation(1, kSquare), Annotation(2, kSquare), Annotation(1, kOtherSquare)});
  EXPECT_THAT(Refusal(), HasSubstr("coco.json: annotations 0 and 2 are both \"mug\" and have no "
                                   "track_id"));
}

TEST_F(OutlineFiles, OfCocoAreRefusedWithTheAnnotationAndTheRemedy) {
  for (const auto& [annotation, message] : std::vector<std::pair<std::string, std::string>>{
           {Annotation(3, kSquare), "annotation 1: no category has the id 3"},
           {R"({"image_id": 8, "category_id": 1, "segmentation": []})",
            "annotation 1: no image has the id 8"},
           {Annotation(1, "[]"),
            "annotation 1: segmentation is []: expected polygons or run lengths; outline the "
            "thing"},
           {Annotation(1, "[[0,0,2,0,2]]"), "annotation 1: polygon 0 is [0,0,2,0,2]: expected"},
           {Annotation(1, "[[0,0,2,0,2,2],[0,0,1,1,2,\"x\"]]"), "annotation 1: polygon 1 is "},
           {Annotation(1, R"({"size": [8, 4], "counts": [32]})"), "expected \"size\": [4, 8]"},
           {Annotation(1, R"({"size": [4, 8], "counts": [31]})"),
            "annotation 1: counts: mask: the runs have 31 pixels, not 32"}}) {
    WriteAnnotations({Annotation(2, kSquare), annotation});
    EXPECT_THAT(Refusal(), AllOf(HasSubstr("coco.json: "), HasSubstr(message))) << annotation;
  }
  Write("coco.json", R"({"images": [{"id": 7, "width": 8, "height": 4}], "annotations": []})");
  EXPECT_THAT(Refusal(), HasSubstr("coco.json: image 0: file_name is null: expected the name"));
}

TEST_F(OutlineFiles, OfOnePhotographMustNotBeTwo) {
  WriteShapes("a.json", {Shape("mug", "null", 0)});
  WriteAnnotations({Annotation(1, kSquare)});
  EXPECT_THAT(Refusal(), HasSubstr("coco.json: the photograph \"a.jpg\" has outlines already, as "
                                   "\"a\" in "));
}

TEST_F(OutlineFiles, OfOtherFormatsAreRefusedOrLeftOut) {
  for (const char* text : {"[1, 2]", "{\"camera\": 3}", "{\"shapes\": [", ""}) {
    Write("a.json", text);
    EXPECT_THAT(Refusal(),
                HasSubstr("a.json: neither outlines of LabelMe (\"shapes\") nor of COCO"))
        << text;
    const auto others = ReadOutlines(folder_.path(), /*refuse_others=*/false);
    ASSERT_OK(others);
    EXPECT_THAT(*others, IsEmpty());
  }
}

}  // namespace
}  // namespace pepeseg::client::cli
