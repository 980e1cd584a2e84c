#include "core/annotations/annotation_writer.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstring>
#include <nlohmann/json.hpp>
#include <regex>
#include <sstream>

#include "core/formats/image_header.h"
#include "core/formats/png_file.h"
#include "tests/core/annotations/annotated_books.h"
#include "tests/core/annotations/filled_polygons.h"

namespace pepeseg {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::Key;
using Json = nlohmann::json;

TEST(ThingsOf, GiveCategoryInstanceAndTrack) {
  const std::vector<LabelText> labels = {{"a", "mug"},   {"b", "mug.2"}, {"c", "mug"},
                                         {"d", "mug.2"}, {"e", ""},      {"f", "v1.0"}};
  std::vector<std::string> names;
  for (const AnnotatedThing& thing : ThingsOf(labels)) {
    names.push_back(thing.category + "/" + std::to_string(thing.instance) + "/" +
                    std::to_string(thing.track));
  }
  EXPECT_THAT(names,
              ElementsAre("mug/1/1", "mug/2/2", "mug/3/3", "mug.2/1/4", "e/1/5", "v1.0/1/6"));
}

struct AnnotationWriterTest : ::testing::Test, AnnotatedBooks {};

TEST_F(AnnotationWriterTest, HasTheRunLengthsInCoco) {
  const auto files = Write(AnnotationFormat::kCoco);
  ASSERT_THAT(files, ElementsAre(Key("annotations.json")));
  const Json json = Json::parse(files.at("annotations.json"));
  ASSERT_EQ(json["images"].size(), 2U);
  EXPECT_EQ(json["images"][1]["file_name"], "cam0/b.jpg");
  EXPECT_EQ(json["categories"][0]["name"], "Book & \"<pen>\"");
  const Json& annotations = json["annotations"];
  ASSERT_EQ(annotations.size(), 4U);
  const BinaryMask* const want[] = {&masks[0][0], &masks[0][1], &masks[1][1], &masks[1][2]};
  for (size_t i = 0; i < 4; ++i) {
    EXPECT_EQ(annotations[i]["segmentation"]["counts"], EncodeCocoRle(*want[i], 6, 4));
    EXPECT_EQ(annotations[i]["segmentation"]["size"], Json({4, 6}));
    EXPECT_EQ(annotations[i]["id"], i + 1);
  }
  EXPECT_EQ(annotations[0]["area"], 15);
  EXPECT_EQ(annotations[1]["bbox"], Json({4, 1, 2, 2}));
  EXPECT_EQ(annotations[1]["track_id"], annotations[2]["track_id"]);
  EXPECT_EQ(annotations[1]["category_id"], annotations[3]["category_id"]);
  EXPECT_NE(annotations[2]["instance_id"], annotations[3]["instance_id"]);
}

TEST_F(AnnotationWriterTest, HasALineForEachThingInYolo) {
  const auto files = Write(AnnotationFormat::kYolo);
  ASSERT_THAT(files, ElementsAre(Key("data.yaml"), Key("labels/cam0/a.txt"),
                                 Key("labels/cam0/b.txt"), Key("things.json"), Key("tracks.csv")));
  EXPECT_EQ(files.at("tracks.csv"),
            "file,line,track_id\nlabels/cam0/a.txt,1,1\nlabels/cam0/a.txt,2,2\n"
            "labels/cam0/b.txt,1,2\nlabels/cam0/b.txt,2,3\n");
  EXPECT_THAT(files.at("data.yaml"),
              HasSubstr("names:\n  0: \"Book & \\\"<pen>\\\"\"\n  1: \"mug\"\n"));
  EXPECT_EQ(Json::parse(files.at("things.json"))[2]["track_id"], 3);
  const std::pair<int, const BinaryMask*> want[2][2] = {{{0, &masks[0][0]}, {1, &masks[0][1]}},
                                                        {{1, &masks[1][1]}, {1, &masks[1][2]}}};
  for (size_t v = 0; v < 2; ++v) {
    std::istringstream lines(files.at(v == 0 ? "labels/cam0/a.txt" : "labels/cam0/b.txt"));
    for (const auto& [category, mask] : want[v]) {
      std::string line;
      ASSERT_TRUE(std::getline(lines, line));
      std::istringstream numbers(line);
      int number = -1;
      numbers >> number;
      EXPECT_EQ(number, category);
      Polygon polygon;
      for (PolygonPoint point; numbers >> point.x >> point.y;) {
        EXPECT_TRUE(point.x >= 0 && point.x <= 1 && point.y >= 0 && point.y <= 1) << line;
        polygon.push_back({point.x * 6, point.y * 4});
      }
      EXPECT_EQ(Filled({polygon}, kSize), mask->pixels);
    }
  }
}

TEST_F(AnnotationWriterTest, HasPolygonsInLabelMe) {
  const auto files = Write(AnnotationFormat::kLabelMe);
  ASSERT_THAT(files, ElementsAre(Key("cam0/a.json"), Key("cam0/b.json")));
  for (size_t v = 0; v < 2; ++v) {
    const Json json = Json::parse(files.at(v == 0 ? "cam0/a.json" : "cam0/b.json"));
    EXPECT_EQ(json["imagePath"], v == 0 ? "a.jpg" : "b.jpg");
    EXPECT_EQ(json["imageWidth"], 6);
    EXPECT_EQ(json["imageHeight"], 4);
    std::vector<std::vector<Polygon>> polygons(3);
    for (const Json& shape : json["shapes"]) {
      Polygon& polygon = polygons.at(shape["group_id"].get<size_t>() - 1).emplace_back();
      for (const Json& point : shape["points"]) polygon.push_back({point[0], point[1]});
    }
    for (size_t t = 0; t < 3; ++t) EXPECT_EQ(Filled(polygons[t], kSize), masks[v][t].pixels);
  }
  EXPECT_THAT(files.at("cam0/a.json"), HasSubstr("\"description\": \"mug.2\""));
}

// Returns the samples of a grey PNG of 6 x 4 pixels.
std::vector<uint8_t> GreyOf(const std::string& png, int bit_depth = 8) {
  const std::span<const uint8_t> bytes(reinterpret_cast<const uint8_t*>(png.data()), png.size());
  const auto header = ReadImageHeader("png", bytes);
  EXPECT_OK(header.status());
  const auto pixels = DecodePng(bytes, *header, "png", PngForm::kStored);
  EXPECT_OK(pixels.status());
  EXPECT_EQ(pixels->channels, 1);
  EXPECT_EQ(pixels->bit_depth, bit_depth);
  return pixels->bytes;
}

TEST_F(AnnotationWriterTest, HasAPngForEachLabelAndView) {
  const auto files = Write(AnnotationFormat::kMasks);
  ASSERT_EQ(files.size(), 7U);
  for (size_t v = 0; v < 2; ++v) {
    for (size_t t = 0; t < 3; ++t) {
      std::vector<uint8_t> want = masks[v][t].pixels;
      for (uint8_t& pixel : want) pixel = pixel != 0 ? 255 : 0;
      const std::string name = scene.things[t].id + (v == 0 ? "/cam0/a.png" : "/cam0/b.png");
      EXPECT_EQ(GreyOf(files.at(name)), want) << name;
    }
  }
  EXPECT_EQ(Json::parse(files.at("things.json"))[0]["label"], "book");
}

TEST_F(AnnotationWriterTest, HasTheTrackOfEachPixel) {
  const auto files = Write(AnnotationFormat::kIds);
  ASSERT_THAT(files, ElementsAre(Key("cam0/a.png"), Key("cam0/b.png"), Key("things.json")));
  EXPECT_EQ(GreyOf(files.at("cam0/a.png")), std::vector<uint8_t>({1, 1, 1, 1, 0, 0,  //
                                                                  1, 0, 1, 1, 2, 2,  //
                                                                  1, 1, 1, 1, 2, 2,  //
                                                                  1, 1, 1, 1, 0, 0}));
  // Both mugs have the fourth column; the second one has fewer pixels.
  EXPECT_EQ(GreyOf(files.at("cam0/b.png")), std::vector<uint8_t>({0, 0, 0, 3, 0, 0,  //
                                                                  0, 2, 2, 3, 0, 0,  //
                                                                  0, 2, 0, 3, 0, 0,  //
                                                                  0, 2, 2, 3, 0, 0}));
  scene.things[2].track = 256;
  const std::vector<uint8_t> wide = GreyOf(Write(AnnotationFormat::kIds).at("cam0/b.png"), 16);
  uint16_t id = 0;
  std::memcpy(&id, wide.data() + 2 * 3, sizeof(id));
  EXPECT_EQ(id, 256);
}

TEST_F(AnnotationWriterTest, HasRunLengthsInCvat) {
  const auto files = Write(AnnotationFormat::kCvat);
  ASSERT_THAT(files, ElementsAre(Key("annotations.xml"), Key("labels.json")));
  const std::string& xml = files.at("annotations.xml");
  EXPECT_THAT(xml, HasSubstr("<image id=\"1\" name=\"cam0/b.jpg\" width=\"6\" height=\"4\">"));
  EXPECT_THAT(xml, HasSubstr("<name>Book &amp; &quot;&lt;pen&gt;&quot;</name>"));
  const std::regex element(
      "<image id=\"(\\d+)\"|<mask label=\"([^\"]*)\" [^>]*rle=\"([^\"]*)\" left=\"(\\d+)\" "
      "top=\"(\\d+)\" width=\"(\\d+)\" height=\"(\\d+)\"[^>]*>\\s*"
      "<attribute name=\"instance_id\">(\\d+)</attribute>\\s*"
      "<attribute name=\"track_id\">(\\d+)</attribute>\\s*</mask>");
  std::vector<std::vector<BinaryMask>> read(2, std::vector<BinaryMask>(3, BoxMask(0, 0, 0, 0)));
  size_t view = 0;
  for (std::sregex_iterator match(xml.begin(), xml.end(), element), end; match != end; ++match) {
    if ((*match)[1].matched) {
      view = std::stoul((*match)[1]);
      continue;
    }
    const size_t thing = std::stoul((*match)[9]) - 1;
    EXPECT_EQ((*match)[2], thing == 0 ? "Book &amp; &quot;&lt;pen&gt;&quot;" : "mug");
    EXPECT_EQ(std::stol((*match)[8]), scene.things[thing].instance);
    std::string runs = (*match)[3];
    std::replace(runs.begin(), runs.end(), ',', ' ');
    std::istringstream counts(runs);
    size_t at = 0;
    uint8_t value = 0;
    for (size_t count = 0; counts >> count; value ^= 1) {
      for (size_t i = 0; i < count; ++i, ++at) {
        const size_t width = std::stoul((*match)[6]);
        const size_t x = std::stoul((*match)[4]) + at % width;
        const size_t y = std::stoul((*match)[5]) + at / width;
        read[view][thing].pixels.at(6 * y + x) = value;
      }
    }
    EXPECT_EQ(at, std::stoul((*match)[6]) * std::stoul((*match)[7]));
  }
  for (size_t v = 0; v < 2; ++v) {
    for (size_t t = 0; t < 3; ++t) EXPECT_EQ(read[v][t].pixels, masks[v][t].pixels) << v << t;
  }
  const Json labels = Json::parse(files.at("labels.json"));
  ASSERT_EQ(labels.size(), 2U);
  EXPECT_EQ(labels[1]["name"], "mug");
  EXPECT_EQ(labels[1]["attributes"][1]["name"], "track_id");
  for (const Json& label : labels) {
    EXPECT_THAT(xml, HasSubstr("<color>" + label["color"].get<std::string>() + "</color>"));
  }
  EXPECT_NE(labels[0]["color"], labels[1]["color"]);
}

TEST_F(AnnotationWriterTest, HasPngsOfSegmentsWhereTheyAreSeen) {
  scene.are_segments = true;
  EXPECT_THAT(Write(AnnotationFormat::kMasks),
              ElementsAre(Key("book/cam0/a.png"), Key("mug-2/cam0/b.png"), Key("mug/cam0/a.png"),
                          Key("mug/cam0/b.png"), Key("things.json")));
}

TEST_F(AnnotationWriterTest, NamesFilesAfterTheirViews) {
  scene.views = {"a.jpg", "a.png", "b.c.jpg", "cam/d.jpg"};
  EXPECT_THAT(FilesOfViews(scene, ".txt"),
              ElementsAre("a.jpg.txt", "a.png.txt", "b.c.txt", "cam/d.txt"));
  scene.views = {"../../outside.jpg", "/tmp/outside.png", "x/../../y.jpg", "x/../z.jpg"};
  EXPECT_THAT(FilesOfViews(scene, ".txt"),
              ElementsAre("view..-..-outside.txt", "-tmp-outside.txt", "x-..-..-y.txt", "z.txt"));
}

TEST_F(AnnotationWriterTest, RefusesMalformedMasks) {
  for (const AnnotationFormat format :
       {AnnotationFormat::kCoco, AnnotationFormat::kYolo, AnnotationFormat::kLabelMe,
        AnnotationFormat::kMasks, AnnotationFormat::kCvat, AnnotationFormat::kIds}) {
    ZipWriter zip;
    const auto writer = MakeAnnotationWriter(format, scene, zip);
    const std::string half = EncodeCocoRle({{0, 1, 1, 0}}, 2, 2);
    EXPECT_TRUE(absl::IsInvalidArgument(writer->Add({0, kSize, {half, half, half}})));
  }
}

}  // namespace
}  // namespace pepeseg
