#include "clients/cli/request_flags.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>

#include "clients/terminal/flags.h"
#include "tests/testing/status_testing.h"
#include "tests/testing/temp_folder.h"

namespace pepeseg::client::cli {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

// Returns the names that a command line gives to an option of names.
std::vector<std::string> NamesOf(const std::string& command_line) {
  CLI::App app;
  std::vector<std::string> names;
  AddNamesFlag(app, "--views", names, "Views");
  app.parse(command_line);
  return names;
}

TEST(AddNamesFlag, TakesListsAndRepetitions) {
  EXPECT_THAT(NamesOf(""), ElementsAre());
  EXPECT_THAT(NamesOf("--views all"), ElementsAre("all"));
  EXPECT_THAT(NamesOf("--views a.jpg,b/c.jpg"), ElementsAre("a.jpg", "b/c.jpg"));
  EXPECT_THAT(NamesOf("--views a.jpg --views=b.jpg,c.jpg"), ElementsAre("a.jpg", "b.jpg", "c.jpg"));
  EXPECT_THAT(NamesOf("--views a.jpg b.jpg,"), ElementsAre("a.jpg", "b.jpg"));
}

TEST(AddNamesFlag, ReadsNamesInATextFile) {
  const testing::TempFolder folder;
  std::ofstream(folder / "views.txt") << "b/c.jpg\n\n a, b.jpg \r\n";
  const std::string list = (folder / "views.txt").string();
  EXPECT_THAT(NamesOf("--views x.jpg,y.jpg --views " + list),
              ElementsAre("x.jpg", "y.jpg", "b/c.jpg", "a, b.jpg"));
  // A photograph is not a list.
  const std::string photograph = (folder / "a.png").string();
  std::ofstream(photograph, std::ios::binary) << std::string("\x89PNG\r\n\x1a\n\0\0", 10);
  EXPECT_THAT(NamesOf("--views " + photograph), ElementsAre(photograph));
}

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
