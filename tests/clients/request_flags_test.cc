#include "clients/cli/request_flags.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/testing/status_testing.h"

namespace pepeseg::client::cli {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

TEST(ParseSubset, NamesASegmentOrASelection) {
  const auto all = ParseSubset({}, "shelf");
  ASSERT_OK(all);
  EXPECT_EQ(all->of_case(), v1::Subset::OF_NOT_SET);
  SubsetFlags flags;
  flags.segment = "1:12";
  flags.scales = {0.1, 0.9};
  flags.without = true;
  const auto segment = ParseSubset(flags, "shelf");
  ASSERT_OK(segment);
  EXPECT_EQ(segment->segment().level(), 1);
  EXPECT_EQ(segment->segment().id(), 12);
  EXPECT_THAT(segment->segment().scales(), ElementsAre(0.1, 0.9));
  EXPECT_TRUE(segment->complement());
  flags.segment.clear();
  flags.selection = 4;
  const auto selection = ParseSubset(flags, "shelf");
  ASSERT_OK(selection);
  EXPECT_EQ(selection->selection(), "scenes/shelf/selections/4");
}

TEST(ParseSubset, RefusesMalformedSegmentsAndWithoutAlone) {
  SubsetFlags flags;
  for (const char* segment : {"1", "1:", ":2", "a:b", "1:2:3", "-1:2", "1:0"}) {
    flags.segment = segment;
    EXPECT_EQ(ParseSubset(flags, "shelf").status().code(), absl::StatusCode::kInvalidArgument)
        << segment;
  }
  flags.segment.clear();
  flags.without = true;
  EXPECT_THAT(std::string(ParseSubset(flags, "shelf").status().message()),
              HasSubstr("--without needs --selection or --segment"));
}

}  // namespace
}  // namespace pepeseg::client::cli
