#include "clients/cli/decompose.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <set>

namespace pepeseg::client::cli {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::StartsWith;

TEST(ColorOfSegment, DiffersBetweenSegments) {
  const Rgb nothing = ColorOfSegment(0);
  EXPECT_EQ(nothing.r + nothing.g + nothing.b, 0);
  std::set<std::array<uint8_t, 3>> colors;
  for (int id = 1; id <= 200; ++id) {
    const Rgb color = ColorOfSegment(id);
    colors.insert({color.r, color.g, color.b});
    EXPECT_GT(color.r + color.g + color.b, 150) << id << " is not black";
  }
  EXPECT_GT(colors.size(), 195u);
  const Picture picture = ColorSegments({2, 1, {0, 5}});
  EXPECT_THAT(picture.pixels,
              ElementsAre(0, 0, 0, ColorOfSegment(5).r, ColorOfSegment(5).g, ColorOfSegment(5).b));
}

TEST(SegmentTree, PutsSegmentsBelowTheirParents) {
  v1::DecomposeModelResponse answer;
  answer.set_model("scenes/shelf/models/1");
  const auto add = [](v1::DecomposeModelResponse::Level& level, int parent, int size) {
    auto& segment = *level.add_segments();
    segment.set_id(level.segments_size());
    segment.set_parent(parent);
    segment.set_num_gaussians(size);
    segment.mutable_box()->mutable_min()->set_x(-1);
    segment.mutable_box()->mutable_max()->set_y(2);
    segment.mutable_box()->mutable_max()->set_z(0.5);
  };
  auto& fine = *answer.add_levels();
  add(fine, 2, 9);
  add(fine, 1, 6);
  add(fine, 1, 5);
  auto& coarse = *answer.add_levels();
  add(coarse, 0, 11);
  add(coarse, 0, 9);
  fine.set_num_unassigned(4);
  const std::vector<std::string> lines = SegmentTree(answer);
  ASSERT_EQ(lines.size(), 8u);
  EXPECT_EQ(lines[0], "scenes/shelf/models/1");
  EXPECT_THAT(lines[1], HasSubstr("3 segments  4 Gaussians in none"));
  EXPECT_THAT(lines[3], StartsWith("  1:1 "));
  EXPECT_THAT(lines[3], HasSubstr("11 Gaussians  1 x 2 x 0.5 scene units"));
  EXPECT_THAT(lines[4], StartsWith("    0:2 "));
  EXPECT_THAT(lines[5], StartsWith("    0:3 "));
  EXPECT_THAT(lines[6], StartsWith("  1:2 "));
  EXPECT_THAT(lines[7], StartsWith("    0:1 "));
}

}  // namespace
}  // namespace pepeseg::client::cli
