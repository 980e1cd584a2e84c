#include "clients/cli/segment_table.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace pepeseg::client::cli {
namespace {

using ::testing::ElementsAre;
using ::testing::SizeIs;

// Two segments at level 0, in one at level 1.
v1::DecomposeModelResponse TwoInOne() {
  v1::DecomposeModelResponse answer;
  for (const int count : {2, 1}) {
    v1::DecomposeModelResponse::Level& level = *answer.add_levels();
    for (int id = 1; id <= count; ++id) {
      auto& segment = *level.add_segments();
      segment.set_id(id);
      segment.set_parent(count == 2 ? 1 : 0);
      segment.set_num_gaussians(100 / id);
      segment.mutable_box()->mutable_min()->set_x(-1.5);
      segment.mutable_box()->mutable_max()->set_z(1e6 + id);
    }
  }
  return answer;
}

TEST(SegmentTable, ListsSegmentsFromTheCoarsestLevelDown) {
  SegmentTable table(TwoInOne());
  table.CountView(0, {3, 2, {1, 1, 0, 2, 1, 0}});
  table.CountView(0, {2, 1, {1, 0}});
  const std::vector<TableRow> rows = table.Rows();
  ASSERT_THAT(rows, SizeIs(4));
  EXPECT_THAT(rows[0], ElementsAre("level", "id", "parent", "name", "gaussians", "views", "pixels",
                                   "min_x", "min_y", "min_z", "max_x", "max_y", "max_z"));
  EXPECT_THAT(rows[1], ElementsAre("1", "1", "0", "", "100", "0", "0", "-1.5", "0", "0", "0", "0",
                                   "1000001"));
  EXPECT_THAT(rows[2], ElementsAre("0", "1", "1", "", "100", "2", "4", "-1.5", "0", "0", "0", "0",
                                   "1000001"));
  EXPECT_THAT(rows[3], ElementsAre("0", "2", "1", "", "50", "1", "1", "-1.5", "0", "0", "0", "0",
                                   "1000002"));
}

TEST(SegmentTable, NamesTheSegmentThatALabelHas) {
  SegmentTable table(TwoInOne());
  const Grey16Picture parts = {4, 1, {1, 1, 2, 0}}, whole = {4, 1, {1, 1, 1, 0}};
  const auto compare = [&](const std::string& text, const std::vector<uint8_t>& mask) {
    table.CompareLabel(text, 0, parts, mask);
    table.CompareLabel(text, 1, whole, mask);
  };
  compare("mug", {1, 1, 1, 0});     // all of level 1
  compare("handle", {0, 0, 1, 0});  // the second part
  compare("grip", {0, 0, 1, 1});    // half of it
  compare("air", {0, 0, 0, 1});     // no segment
  compare("speck", {1, 0, 0, 0});   // IoU 1/2 with the first part, 1/3 with the whole
  compare("other view", {1, 1});    // another size
  const std::vector<TableRow> rows = table.Rows();
  EXPECT_EQ(rows[1][3], "mug");
  EXPECT_EQ(rows[2][3], "speck");
  EXPECT_EQ(rows[3][3], "grip; handle");
}

}  // namespace
}  // namespace pepeseg::client::cli
