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

// Returns the prompt of a command line.
absl::StatusOr<v1::Prompt> PromptFrom(const std::string& command_line) {
  CLI::App app;
  PromptFlags flags;
  AddPromptFlags(app, flags);
  app.parse("shelf " + command_line);
  return ParsePrompt(flags);
}

TEST(PromptFlags, BecomeAPromptOfOneKind) {
  auto prompt = PromptFrom("--view a.jpg -p 1,2 -p 3,4 -n 5,6");
  ASSERT_OK(prompt);
  EXPECT_EQ(prompt->view().view(), "a.jpg");
  ASSERT_EQ(prompt->points().points_size(), 3);
  EXPECT_EQ(prompt->points().points(1).y(), 4);
  EXPECT_TRUE(prompt->points().points(2).negative());
  EXPECT_EQ(PromptFrom("--view a.jpg --box 1,2,3,4")->box().height(), 4);
  EXPECT_EQ(PromptFrom("--label red")->label(), "red");
  EXPECT_THROW(PromptFrom("--label red --view a.jpg"), CLI::Error);
  EXPECT_THROW(PromptFrom("--view a.jpg"), CLI::Error);
  EXPECT_THROW(PromptFrom("--view a.jpg --box 1,2,3,4 --point 1,2"), CLI::Error);
  EXPECT_THROW(PromptFrom("--point 1,2"), CLI::Error);
  EXPECT_THROW(PromptFrom("--view a.jpg --box 1,2,3,4 --negative 1,2"), CLI::Error);
}

TEST(PromptFlags, DrawLines) {
  const auto prompt = PromptFrom(
      "--view a.jpg --scribble \"1,2  3,4 5,6.5\" --scribble 7,8 --not-scribble \"9,9 9,8\" "
      "--stroke-width 3");
  ASSERT_OK(prompt);
  ASSERT_EQ(prompt->scribbles().strokes_size(), 3);
  const v1::ScribblesPrompt::Stroke& first = prompt->scribbles().strokes(0);
  ASSERT_EQ(first.path_size(), 3);
  EXPECT_EQ(first.path(2).y(), 6.5);
  EXPECT_EQ(first.width(), 3);
  EXPECT_FALSE(first.negative());
  EXPECT_EQ(prompt->scribbles().strokes(1).path_size(), 1);
  EXPECT_TRUE(prompt->scribbles().strokes(2).negative());
  EXPECT_EQ(PromptFrom("--view a.jpg --scribble \"1,2 3\"").status().code(),
            absl::StatusCode::kInvalidArgument);
  EXPECT_THROW(PromptFrom("--view a.jpg --not-scribble 1,2 -p 3,4"), CLI::Error);
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
