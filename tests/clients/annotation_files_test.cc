#include "clients/cli/annotation_files.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <sstream>
#include <string>
#include <vector>

#include "clients/benchmark/outline_files.h"
#include "clients/benchmark/outlines.h"
#include "clients/cpp/mask.h"
#include "tests/testing/status_testing.h"
#include "tests/testing/temp_folder.h"

namespace pepeseg::client::cli {
namespace {

using ::testing::ElementsAre;

constexpr PixelSize kSize{6, 4};

v1::Label LabelOf(const std::string& id, const std::string& text) {
  v1::Label label;
  label.set_name("scenes/shelf/labels/" + id);
  label.set_text(text);
  label.set_view("a.jpg");
  return label;
}

// Returns a mask with the pixels of a box, and a hole of one pixel.
Mask BoxMask(int x, int y, int width, int height) {
  Mask mask(static_cast<size_t>(kSize.width) * kSize.height, 0);
  for (int v = y; v < y + height; ++v) {
    for (int u = x; u < x + width; ++u) mask[static_cast<size_t>(v) * kSize.width + u] = 1;
  }
  if (width > 2 && height > 2) mask[static_cast<size_t>(y + 1) * kSize.width + x + 1] = 0;
  return mask;
}

v1::CocoRle Rle(const Mask& mask) { return EncodeRle(mask, kSize.width, kSize.height); }

// Two mugs and a book in two views; the second mug is in the second view only.
LabelledMasks ThreeThings() {
  LabelledMasks masks;
  masks.scene = "scenes/shelf";
  masks.things =
      ThingsOf({LabelOf("book", "Book"), LabelOf("mug", "mug.2"), LabelOf("mug-2", "mug")});
  const Mask none(BoxMask(0, 0, 0, 0));
  masks.views = {
      {"cam0/a.jpg", kSize, {Rle(BoxMask(0, 0, 4, 4)), Rle(BoxMask(4, 1, 2, 2)), Rle(none)}},
      {"cam0/b.jpg", kSize, {Rle(none), Rle(BoxMask(1, 1, 3, 3)), Rle(BoxMask(5, 0, 1, 4))}}};
  return masks;
}

TEST(ThingsOf, GiveCategoryInstanceAndTrack) {
  const auto things = ThingsOf({LabelOf("a", "mug"), LabelOf("b", "mug.2"), LabelOf("c", "mug"),
                                LabelOf("d", "mug.2"), LabelOf("e", ""), LabelOf("f", "v1.0")});
  std::vector<std::string> names;
  for (const LabelledThing& thing : things) {
    names.push_back(thing.category + "/" + std::to_string(thing.instance) + "/" +
                    std::to_string(thing.track));
  }
  EXPECT_THAT(names,
              ElementsAre("mug/1/1", "mug/2/2", "mug/3/3", "mug.2/1/4", "e/1/5", "v1.0/1/6"));
}

// Writes the masks and reads them as outlines: each thing has the same name and mask in all views.
void ExpectRoundTrip(const std::string& format, const std::string& file) {
  const ::pepeseg::testing::TempFolder folder;
  const LabelledMasks masks = ThreeThings();
  const auto path = folder.path() / file;
  ASSERT_OK(WriteAnnotations(masks, format, path));
  const auto read = ReadOutlines(path, true);
  ASSERT_OK(read.status());
  ASSERT_EQ(read->size(), 2U);
  for (const LabelledView& view : masks.views) {
    const OutlinedPhotograph* photograph = OutlinesOf(*read, view.view);
    ASSERT_NE(photograph, nullptr) << view.view;
    EXPECT_EQ(photograph->size, kSize);
    for (const OutlinedEntity& entity : photograph->entities) {
      const auto thing = std::find_if(
          masks.things.begin(), masks.things.end(), [&](const LabelledThing& candidate) {
            return entity.name == candidate.category + "." + std::to_string(candidate.track);
          });
      ASSERT_NE(thing, masks.things.end()) << entity.name;
      const auto wanted = DecodeRle(view.masks[static_cast<size_t>(thing->track) - 1]);
      EXPECT_EQ(MaskOfEntity(entity, kSize, kSize).pixels, *wanted) << entity.name;
    }
    EXPECT_EQ(photograph->entities.size(), 2U);
  }
}

TEST(AnnotationFiles, GiveTheMasksOfCocoAgain) { ExpectRoundTrip("coco", "things.json"); }
TEST(AnnotationFiles, GiveTheMasksOfLabelMeAgain) { ExpectRoundTrip("labelme", "outlines"); }

TEST(AnnotationFiles, HaveTheRunLengthsOfTheServerInCoco) {
  const LabelledMasks masks = ThreeThings();
  const auto json = nlohmann::json::parse(CocoJson(masks));
  ASSERT_EQ(json["annotations"].size(), 4U);
  EXPECT_EQ(json["annotations"][0]["segmentation"]["counts"], masks.views[0].masks[0].counts());
  EXPECT_EQ(json["annotations"][0]["area"], 15);
  EXPECT_EQ(json["annotations"][1]["bbox"], nlohmann::json({4, 1, 2, 2}));
  EXPECT_EQ(json["annotations"][1]["track_id"], json["annotations"][2]["track_id"]);
  EXPECT_EQ(json["annotations"][1]["category_id"], json["annotations"][3]["category_id"]);
  EXPECT_NE(json["annotations"][2]["instance_id"], json["annotations"][3]["instance_id"]);
}

TEST(AnnotationFiles, HaveALineForEachThingInYolo) {
  const LabelledMasks masks = ThreeThings();
  const auto text = YoloOf(masks, masks.views[1], "labels/cam0/b.txt");
  ASSERT_OK(text.status());
  EXPECT_EQ(text->tracks, "labels/cam0/b.txt,1,2\nlabels/cam0/b.txt,2,3\n");
  std::istringstream lines(text->lines);
  for (const size_t thing : {size_t{1}, size_t{2}}) {
    std::string line;
    ASSERT_TRUE(std::getline(lines, line));
    std::istringstream numbers(line);
    int category = -1;
    numbers >> category;
    EXPECT_EQ(category, 1) << "the index of \"mug\"";
    Polygon polygon;
    for (OutlinePoint point; numbers >> point.x >> point.y;) {
      polygon.push_back({point.x * kSize.width, point.y * kSize.height});
    }
    const OutlinedEntity entity{"mug", {{{polygon}, {}}}};
    EXPECT_EQ(MaskOfEntity(entity, kSize, kSize).pixels, *DecodeRle(masks.views[1].masks[thing]));
  }
}

TEST(AnnotationFiles, StayInTheirFolder) {
  const ::pepeseg::testing::TempFolder folder;
  LabelledMasks masks = ThreeThings();
  masks.views[0].view = "../../outside.jpg";
  masks.views[1].view = "/tmp/outside.png";
  for (const char* format : {"yolo", "labelme", "masks"}) {
    ASSERT_OK(WriteAnnotations(masks, format, folder.path() / "below" / format));
  }
  for (const auto& entry : std::filesystem::directory_iterator(folder.path())) {
    EXPECT_EQ(entry.path().filename(), "below");
  }
  EXPECT_FALSE(std::filesystem::exists("/tmp/outside.json"));
}

}  // namespace
}  // namespace pepeseg::client::cli
