#include "tests/bench/option_flags.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace pepeseg {
namespace {

struct FlaggedOptions {
  int count = 3;
  bool on = true;
};
void VisitOptions(FlaggedOptions& o, OptionVisitor visit) {
  visit({"count", &o.count, Range{1, 10}});
  visit({"on", &o.on});
}

// Parses a command line into `options`. Returns the message of the error; empty: there was none.
std::string Parse(const std::string& line, FlaggedOptions& options) {
  CLI::App app;
  AddOptionFlags(app, options);
  try {
    app.parse(line);
  } catch (const CLI::ParseError& error) {
    return error.what();
  }
  return "";
}

TEST(OptionFlags, SetEveryOptionThatHasARow) {
  FlaggedOptions options;
  EXPECT_EQ(Parse("-o count=7 --option on=false", options), "");
  EXPECT_EQ(options.count, 7);
  EXPECT_FALSE(options.on);
}

TEST(OptionFlags, RefuseWhatTheRowsRefuse) {
  FlaggedOptions options;
  using ::testing::HasSubstr;
  EXPECT_THAT(Parse("-o count=11", options), HasSubstr("count is \"11\", must be in [1, 10]"));
  EXPECT_THAT(Parse("-o coun=1", options), HasSubstr("did you mean count?"));
  EXPECT_THAT(Parse("-o count", options), HasSubstr("count is \"\""));
  EXPECT_EQ(options.count, 3);
}

TEST(OptionFlags, ListEveryOptionThatHasARow) {
  FlaggedOptions options;
  ::testing::internal::CaptureStdout();
  Parse("--list-options", options);
  EXPECT_EQ(::testing::internal::GetCapturedStdout(), "count=3  [1, 10]\non=true  true or false\n");
}

}  // namespace
}  // namespace pepeseg
