#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <set>

#include "clients/cli/picture.h"
#include "clients/cli/segment_colors.h"
#include "clients/cli/segment_tree.h"
#include "clients/cli/subset.h"

namespace pepeseg::client::cli {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::StartsWith;

// 2 x 1 pixels of 16 bits grey: 3 and 258.
constexpr unsigned char kGrey16[] = {
    0x89, 0x50, 0x4e, 0x47, 0x0d, 0x0a, 0x1a, 0x0a, 0x00, 0x00, 0x00, 0x0d, 0x49, 0x48,
    0x44, 0x52, 0x00, 0x00, 0x00, 0x02, 0x00, 0x00, 0x00, 0x01, 0x10, 0x00, 0x00, 0x00,
    0x00, 0x81, 0xd9, 0xfc, 0x15, 0x00, 0x00, 0x00, 0x0d, 0x49, 0x44, 0x41, 0x54, 0x78,
    0x9c, 0x63, 0x60, 0x60, 0x66, 0x64, 0x02, 0x00, 0x00, 0x12, 0x00, 0x07, 0x2a, 0x14,
    0xd9, 0x1f, 0x00, 0x00, 0x00, 0x00, 0x49, 0x45, 0x4e, 0x44, 0xae, 0x42, 0x60, 0x82};

TEST(DecodeGrey16, KeepsAllBits) {
  const absl::string_view bytes(reinterpret_cast<const char*>(kGrey16), sizeof(kGrey16));
  const auto picture = DecodeGrey16(bytes, "ids");
  ASSERT_TRUE(picture.ok()) << picture.status();
  EXPECT_EQ(picture->width, 2);
  EXPECT_EQ(picture->height, 1);
  EXPECT_THAT(picture->pixels, ElementsAre(3, 258));
}

TEST(DecodeGrey16, RefusesOtherPictures) {
  const auto eight = DecodeGrey16(EncodePng(GreyPicture{2, 1, {3, 9}}), "ids");
  EXPECT_EQ(eight.status().code(), absl::StatusCode::kInvalidArgument);
  EXPECT_THAT(std::string(eight.status().message()), HasSubstr("ids: not grey of 16 bits"));
  const auto none = DecodeGrey16("nonsense", "ids");
  EXPECT_EQ(none.status().code(), absl::StatusCode::kInvalidArgument);
}

TEST(ColorOfSegment, TellsSegmentsApart) {
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
  v1::DecomposeResponse answer;
  answer.set_model("scenes/shelf/models/1");
  const auto add = [](v1::DecomposeResponse::Level& level, int parent, int size) {
    auto& segment = *level.add_segments();
    segment.set_id(level.segments_size());
    segment.set_parent(parent);
    segment.set_num_gaussians(size);
    for (const double value : {0.0, 0.0, 0.0}) segment.add_min(value);
    for (const double value : {1.0, 2.0, 0.5}) segment.add_max(value);
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

TEST(ParseSubset, SaysWhichGaussiansAreMeant) {
  const auto all = ParseSubset({}, "shelf");
  ASSERT_TRUE(all.ok());
  EXPECT_EQ(all->of_case(), v1::Subset::OF_NOT_SET);
  SubsetFlags flags;
  flags.segment = "1:12";
  flags.scales = {0.1, 0.9};
  flags.without = true;
  const auto segment = ParseSubset(flags, "shelf");
  ASSERT_TRUE(segment.ok());
  EXPECT_EQ(segment->segment().level(), 1);
  EXPECT_EQ(segment->segment().id(), 12);
  EXPECT_THAT(segment->segment().scales(), ElementsAre(0.1, 0.9));
  EXPECT_TRUE(segment->complement());
  flags.segment.clear();
  flags.selection = 4;
  const auto selection = ParseSubset(flags, "shelf");
  ASSERT_TRUE(selection.ok());
  EXPECT_EQ(selection->selection(), "scenes/shelf/selections/4");
}

TEST(ParseSubset, RefusesWhatNamesNothing) {
  SubsetFlags flags;
  for (const char* segment : {"1", "1:", ":2", "a:b", "1:2:3", "-1:2", "1:0"}) {
    flags.segment = segment;
    EXPECT_EQ(ParseSubset(flags, "shelf").status().code(), absl::StatusCode::kInvalidArgument)
        << segment;
  }
  flags.segment.clear();
  flags.without = true;
  EXPECT_THAT(std::string(ParseSubset(flags, "shelf").status().message()),
              HasSubstr("--without what?"));
}

}  // namespace
}  // namespace pepeseg::client::cli
