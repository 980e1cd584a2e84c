#include "core/annotations/things_table.h"

#include <gtest/gtest.h>

#include "core/formats/rle.h"
#include "tests/testing/status_testing.h"

namespace pepeseg {
namespace {

constexpr int kWidth = 20, kHeight = 10;

struct ThingsTableTest : ::testing::Test {
  static std::string Box(int x, int y, int width, int height) {
    BinaryMask mask{std::vector<uint8_t>(size_t{kWidth} * kHeight, 0)};
    for (int v = y; v < y + height; ++v) {
      for (int u = x; u < x + width; ++u) mask.pixels[static_cast<size_t>(v) * kWidth + u] = 1;
    }
    return EncodeCocoRle(mask, kWidth, kHeight);
  }

  AnnotatedScene scene = {
      "scenes/shelf",
      ThingsOf(std::vector<LabelText>{
          {"cup", "cup"}, {"grip", "grip, of \"cup\""}, {"shelf", "shelf"}, {"side", "side"}}),
      {"a.jpg", "b.jpg"}};
  ThingsTable table{scene};
};

// The grip is in the cup, but for one pixel of ten, and the cup in the shelf. Half of the side is
// in the cup. The second view shows the grip alone.
TEST_F(ThingsTableTest, CountsAndFindsParents) {
  const RasterSize size{kWidth, kHeight};
  ASSERT_OK(table.Add(
      {0, size, {Box(2, 2, 9, 5), Box(2, 4, 10, 1), Box(0, 0, 20, 10), Box(9, 2, 4, 5)}}));
  ASSERT_OK(
      table.Add({1, size, {Box(0, 0, 0, 0), Box(5, 5, 3, 3), Box(0, 0, 0, 0), Box(0, 0, 0, 0)}}));
  EXPECT_EQ(table.ParentOf(0), 2U);
  EXPECT_EQ(table.ParentOf(1), 0U);
  EXPECT_EQ(table.ParentOf(2), std::nullopt);
  EXPECT_EQ(table.ParentOf(3), 2U);
  const std::vector<ThingGaussians> gaussians = {{7, {-1, 0, 0.125}, {1, 2, 3}},
                                                 {3, {0, 0, 0}, {1, 1, 1}},
                                                 {900, {-9, -9, -9}, {9, 9, 9}},
                                                 {}};
  EXPECT_EQ(table.Csv(gaussians),
            "id,parent,name,category,instance_id,track_id,gaussians,views,pixels,"
            "min_x,min_y,min_z,max_x,max_y,max_z\n"
            "cup,shelf,cup,cup,1,1,7,1,45,-1,0,0.125,1,2,3\n"
            "grip,cup,\"grip, of \"\"cup\"\"\",\"grip, of \"\"cup\"\"\",1,2,3,2,19,0,0,0,1,1,1\n"
            "shelf,,shelf,shelf,1,3,900,1,200,-9,-9,-9,9,9,9\n"
            "side,shelf,side,side,1,4,0,1,20,,,,,,\n");
}

TEST_F(ThingsTableTest, HasNoParentOfEqualThings) {
  const std::string same = Box(2, 2, 4, 4);
  ASSERT_OK(table.Add({0, {kWidth, kHeight}, {same, same, Box(0, 0, 0, 0), Box(4, 4, 3, 3)}}));
  for (size_t thing = 0; thing < 4; ++thing) EXPECT_EQ(table.ParentOf(thing), std::nullopt);
  EXPECT_TRUE(
      absl::IsInvalidArgument(table.Add({1, {kWidth, kHeight}, {"\x01", same, same, same}})));
}

TEST_F(ThingsTableTest, TakesTheParentsOfSegments) {
  scene.are_segments = true;
  ThingsTable segments(scene);
  const std::string none = Box(0, 0, 0, 0), all = Box(0, 0, 20, 10);
  ASSERT_OK(segments.Add({0, {kWidth, kHeight}, {Box(2, 2, 4, 4), none, all, none}}));
  EXPECT_EQ(segments.ParentOf(0), std::nullopt);
  const ThingGaussians in_two{1, {}, {}, "1-2"}, in_none{1, {}, {}, ""};
  const std::string csv = segments.Csv({in_two, in_none, in_none, in_none});
  EXPECT_NE(csv.find("\ncup,1-2,cup,"), std::string::npos) << csv;
  EXPECT_NE(csv.find("\nshelf,,shelf,"), std::string::npos) << csv;
}

}  // namespace
}  // namespace pepeseg
